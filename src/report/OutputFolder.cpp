#include "genu/report/OutputFolder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "genu/io/Files.h"
#include "genu/scene/Scene.h"

namespace genu::report {
namespace fs = std::filesystem;

namespace {

constexpr std::array<const char*, 8> kOurNames = {"summary.json", "motion.sto", "contact.sto", "pressure.pvd",
                                                  "maps",         "surfaces",   "plots",       "scene"};

fs::path normalize(const fs::path& folder) {
  fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();  // "out/" and "out" are the same folder
}

[[noreturn]] void fail(const fs::path& folder, const std::string& reason) {
  throw InputError("output folder \"" + folder.string() + "\": " + reason);
}

/** Files of an earlier run in `folder`, absent when there was none. Only paths inside the folder are believed. */
std::optional<std::vector<fs::path>> readManifest(const fs::path& folder) {
  const fs::path summary = folder / "summary.json";
  if (!fs::is_regular_file(summary)) return std::nullopt;
  const auto json = nlohmann::json::parse(io::readFile(summary), nullptr, false);
  if (!json.is_object() || json.value("format", nlohmann::json()) != "genu-results") return std::nullopt;
  std::vector<fs::path> files = {"summary.json"};
  if (const auto list = json.find("files"); list != json.end() && list->is_array()) {
    for (const auto& item : *list) {
      if (!item.is_string()) continue;
      const fs::path file = fs::path(item.get<std::string>()).lexically_normal();
      if (file.is_relative() && !file.empty() && *file.begin() != "..") files.push_back(file);
    }
  }
  return files;
}

/** Removes the folders of ours that have become empty. */
void removeEmptyFolders(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code ignored;
  for (const char* name : kOurNames) {
    const fs::path top = folder / name;
    if (!fs::is_directory(top, ignored)) continue;
    folders.push_back(top);
    for (const auto& entry : fs::recursive_directory_iterator(top, ignored)) {
      if (entry.is_directory() && !entry.is_symlink()) folders.push_back(entry.path());
    }
  }
  // Longest first: children before their parents. remove() refuses a folder that is not empty.
  std::sort(folders.begin(), folders.end(),
            [](const fs::path& a, const fs::path& b) { return a.string().size() > b.string().size(); });
  for (const auto& path : folders) fs::remove(path, ignored);
}

}  // namespace

void OutputFolder::check(const fs::path& target) {
  if (target.empty()) throw InputError("output folder: the name is empty");
  const fs::path folder = normalize(target);
  std::error_code error;
  fs::path existing = folder;
  while (!fs::exists(existing, error) && existing.has_relative_path()) existing = existing.parent_path();
  if (!fs::is_directory(existing, error)) fail(target, "\"" + existing.string() + "\" is not a folder");
  if (access(existing.c_str(), W_OK | X_OK) != 0) {
    fail(target, "cannot write in \"" + existing.string() + "\": " + std::strerror(errno));
  }
  if (existing != folder) return;
  // The staging folder goes beside it, so that moving is a rename.
  if (access(folder.parent_path().c_str(), W_OK | X_OK) != 0) {
    fail(target, "cannot write beside it, in \"" + folder.parent_path().string() + "\": " + std::strerror(errno));
  }
  if (readManifest(folder)) return;
  for (const char* name : kOurNames) {
    if (fs::exists(folder / name, error)) {
      fail(target, "it holds a \"" + std::string(name) + "\" that no run of genu wrote; choose another folder");
    }
  }
}

OutputFolder::OutputFolder(const fs::path& folder) : folder_(normalize(folder)) {
  check(folder);
  std::error_code error;
  fs::create_directories(folder_.parent_path(), error);
  if (error) fail(folder, "cannot create \"" + folder_.parent_path().string() + "\": " + error.message());
  std::string name = (folder_.parent_path() / ("." + folder_.filename().string() + ".XXXXXX")).string();
  if (mkdtemp(name.data()) == nullptr)
    fail(folder, std::string("cannot create a folder beside it: ") + std::strerror(errno));
  staging_ = name;
  // mkdtemp makes it private; results get the permissions of any other new folder.
  const mode_t mask = umask(0);
  umask(mask);
  fs::permissions(staging_, static_cast<fs::perms>(0777 & ~mask), error);
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(staging_, ignored);
}

fs::path OutputFolder::file(const fs::path& relative) {
  const fs::path path = staging_ / relative;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) fail(folder_, "cannot create \"" + path.parent_path().string() + "\": " + error.message());
  return path;
}

std::vector<std::string> OutputFolder::listFiles() const {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(staging_)) {
    if (entry.is_regular_file()) files.push_back(entry.path().lexically_relative(staging_).generic_string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

void OutputFolder::commit() {
  std::error_code error;
  if (!fs::exists(folder_)) {
    fs::rename(staging_, folder_, error);
    if (error) fail(folder_, "cannot be created: " + error.message());
    committed_ = true;
    return;
  }
  if (const auto old = readManifest(folder_)) {
    for (const auto& file : *old) fs::remove(folder_ / file, error);
    removeEmptyFolders(folder_);
  }
  std::vector<std::string> files = listFiles();
  // summary.json last: it lists the others, so a folder with one is complete.
  std::stable_partition(files.begin(), files.end(), [](const std::string& file) { return file != "summary.json"; });
  for (const auto& file : files) {
    fs::create_directories((folder_ / file).parent_path(), error);
    if (!error) fs::rename(staging_ / file, folder_ / file, error);
    if (error) fail(folder_, "cannot write \"" + file + "\": " + error.message());
  }
  committed_ = true;
  fs::remove_all(staging_, error);
}

}  // namespace genu::report
