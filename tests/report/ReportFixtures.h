#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <pugixml.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "genu/contact/AnalyticSurface.h"
#include "genu/scene/Scene.h"
#include "genu/scene/SceneFile.h"
#include "genu/scene/Trajectory.h"

namespace genu::report::testing {

/** A folder that is gone after the test. */
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "genu-report-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  /** Everything in it, hidden files included. */
  size_t count() const { return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(path_), {})); }

 private:
  std::filesystem::path path_;
};

inline void write(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

inline std::string read(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline std::vector<unsigned char> decodeBase64(const std::string& text) {
  static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<unsigned char> bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    const size_t digit = digits.find(c);
    if (digit == std::string::npos) throw std::runtime_error("not base64");
    bits = (bits << 6) | static_cast<unsigned>(digit);
    if ((count += 6) >= 8) bytes.push_back(static_cast<unsigned char>((bits >> (count -= 8)) & 255));
  }
  return bytes;
}

/** Values of a DataArray of a .vtp with appended base64 data, as VTK reads it: at `offset` characters after the
 underscore begins the base64 text of a UInt64 byte count followed by the bytes. */
template <class T>
std::vector<T> readArray(const pugi::xml_document& document, const std::string& name) {
  const auto node = document.find_node([&](const pugi::xml_node& n) {
    return std::string(n.name()) == "DataArray" && n.attribute("Name").value() == name;
  });
  if (!node) throw std::runtime_error("no array " + name);
  std::string text = document.child("VTKFile").child("AppendedData").text().get();
  text = text.substr(text.find('_') + 1 + node.attribute("offset").as_ullong());
  std::uint64_t size = 0;
  const auto header = decodeBase64(text.substr(0, 12));
  std::memcpy(&size, header.data(), sizeof(size));
  const auto bytes = decodeBase64(text.substr(0, (size + sizeof(size) + 2) / 3 * 4));
  std::vector<T> values(size / sizeof(T));
  std::memcpy(values.data(), bytes.data() + sizeof(size), size);
  return values;
}

/** Sphere R = 30 mm on a layer of 6 mm over a 10 mm square (`Genu` scene text). */
inline const char* kBallScene = R"(genu: 1
name: ball
surfaces:
  layer: {plane: {y0: 6 mm}}
  ball: {sphere: {R: 30 mm}}
materials:
  polyethylene: {E: 463 MPa, nu: 0.46}
contact:
  knee:
    fixed: {surface: layer, thickness: 6 mm}
    moving: {surface: ball}
    material: polyethylene
    compartments:
      medial: {rectangle: "-5 mm, 5 mm, 0 mm, 5 mm", grid: 20x10}
      lateral: {rectangle: "-5 mm, 5 mm, -5 mm, 0 mm", grid: 20x10}
)";

/** A made-up run: the sphere goes down and up again, `count` frames over one second, deepest 0.2 mm at the middle. */
inline scene::Trajectory makeTrajectory(const scene::Scene& scene, int count) {
  const auto pairs = scene::makeContactPairs(scene);
  scene::Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    scene::Frame frame;
    frame.time_s = static_cast<double>(i) / (count - 1);
    frame.q = {0.01 * i, 0, -0.1, 0, 0.0358 + 0.0008 * std::pow(frame.time_s - 0.5, 2), 0};
    for (const auto& pair : pairs) frame.contacts.push_back(pair->evaluate(scene::takeSix(frame.q)));
    trajectory.frames.push_back(frame);
  }
  trajectory.complete = true;
  trajectory.statusText = "complete";
  return trajectory;
}

}  // namespace genu::report::testing
