#include "genu/io/Files.h"

#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
#include <system_error>

namespace genu::io {

namespace fs = std::filesystem;

std::string readFile(const fs::path& path, const std::string& where) {
  const std::string prefix = where.empty() ? std::string() : where + ": ";
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw InputError(prefix + "file \"" + path.string() + "\" not found");
  if (fs::is_directory(status)) throw InputError(prefix + "\"" + path.string() + "\" is a folder, a file is needed");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw InputError(prefix + "cannot open \"" + path.string() + "\": " + std::strerror(errno));
  std::ostringstream content;
  content << stream.rdbuf();
  if (stream.bad()) throw InputError(prefix + "cannot read \"" + path.string() + "\"");
  return content.str();
}

void writeFileAtomically(const fs::path& path, const std::string& content) {
  static std::atomic<int> counter{0};
  std::error_code error;
  if (path.has_parent_path()) fs::create_directories(path.parent_path(), error);
  if (error) throw ComputationError("cannot create \"" + path.parent_path().string() + "\": " + error.message());
  fs::path temporary = path;
  temporary += "." + std::to_string(::getpid()) + "-" + std::to_string(counter++) + ".part";
  std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
  if (!stream) throw ComputationError("cannot write \"" + path.string() + "\": " + std::strerror(errno));
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream) {
    const std::string reason = std::strerror(errno);
    fs::remove(temporary, error);
    throw ComputationError("cannot write \"" + path.string() + "\": " + reason);
  }
  fs::rename(temporary, path, error);
  if (error) {
    const std::string reason = error.message();
    fs::remove(temporary, error);
    throw ComputationError("cannot write \"" + path.string() + "\": " + reason);
  }
}

std::string calcSha256(const std::string& content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  if (EVP_Digest(content.data(), content.size(), digest.data(), &length, EVP_sha256(), nullptr) != 1) {
    throw ComputationError("SHA-256 is not available in the cryptographic library");
  }
  std::string text;
  for (unsigned int i = 0; i < length; ++i) {
    std::array<char, 3> hex{};
    std::snprintf(hex.data(), hex.size(), "%02x", static_cast<unsigned int>(digest[i]));
    text += hex.data();
  }
  return text;
}

}  // namespace genu::io
