#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>

#include "genu/contact/NurbsPatch.h"
#include "genu/io/NurbsFile.h"

namespace genu::models_test {

namespace fs = std::filesystem;

inline fs::path modelFolder() { return fs::path(GENU_SOURCE_DIR) / "models"; }

inline std::map<std::string, contact::NurbsPatch> readPatches(const fs::path& file) {
  std::map<std::string, contact::NurbsPatch> patches;
  for (const io::NamedPatch& patch : io::readNurbsFile(file))
    patches.emplace(patch.name, contact::NurbsPatch(patch.data));
  return patches;
}

/** A folder that is removed with the object. */
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "genu-models-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

inline int runShell(const std::string& command) {
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

}  // namespace genu::models_test
