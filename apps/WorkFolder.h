#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string>

namespace genu::app {

/** Where the built-in scenes keep their files; gone afterwards. */
class WorkFolder {
 public:
  WorkFolder() : path_(std::filesystem::temp_directory_path() / fmt::format("genu-{}", ::getpid())) { std::filesystem::create_directories(path_); }
  ~WorkFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }
  /** A message without the folder's name, on one line. */
  std::string clean(std::string text) const {
    const std::string name = path_.string() + "/";
    for (size_t at = text.find(name); at != std::string::npos; at = text.find(name, at)) text.erase(at, name.size());
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
  }

 private:
  std::filesystem::path path_;
};

}  // namespace genu::app
