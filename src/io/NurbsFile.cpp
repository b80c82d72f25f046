#include "genu/io/NurbsFile.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "genu/io/Files.h"
#include "genu/io/Suggest.h"
#include "genu/io/Units.h"

namespace genu::io {

namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr int kMaxDegree = 5;

/** A value of the document with its JSON pointer, for messages. */
class Node {
 public:
  Node(const json& value, const fs::path& file, std::string pointer)
      : value_(value), file_(file), pointer_(std::move(pointer)) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(file_.string() + ": " + (pointer_.empty() ? "(root)" : pointer_) + ": " + what);
  }

  std::string show() const {
    const std::string text = value_.dump(-1, ' ', false, json::error_handler_t::replace);
    return text.size() > 60 ? text.substr(0, 60) + "..." : text;
  }

  void requireObject(const std::vector<std::string>& allowed) const {
    if (!value_.is_object()) fail(std::string("is ") + describeType() + ", an object {...} is needed");
    for (const auto& item : value_.items()) {
      if (std::find(allowed.begin(), allowed.end(), item.key()) == allowed.end()) {
        fail(describeUnknown("key", item.key(), allowed));
      }
    }
  }
  bool has(const std::string& key) const { return value_.contains(key); }
  Node at(const std::string& key) const {
    if (!value_.contains(key)) fail("key \"" + key + "\" is missing");
    return {value_[key], file_, pointer_ + "/" + key};
  }

  size_t requireArray(const std::string& of) const {
    if (!value_.is_array()) fail(std::string("is ") + describeType() + ", an array of " + of + " is needed");
    return value_.size();
  }
  Node at(size_t i) const { return {value_[i], file_, pointer_ + "/" + std::to_string(i)}; }

  double getNumber() const {
    if (!value_.is_number()) fail(std::string("is ") + describeType() + ", a number is needed");
    const double number = value_.get<double>();
    if (!std::isfinite(number)) fail("is not finite");
    return number;
  }
  int getInteger(int lowest, int highest) const {
    const bool fits = value_.is_number_integer() && value_ >= lowest && value_ <= highest;
    if (!fits) {
      fail("is " + show() + "; allowed: an integer from " + std::to_string(lowest) + " to " + std::to_string(highest));
    }
    return value_.get<int>();
  }
  std::string getString() const {
    if (!value_.is_string()) fail(std::string("is ") + describeType() + ", a text is needed");
    return value_.get<std::string>();
  }
  bool getBool() const {
    if (!value_.is_boolean()) fail(std::string("is ") + show() + "; allowed: true, false");
    return value_.get<bool>();
  }

 private:
  std::string describeType() const {
    return std::string(value_.is_null() ? "null" : value_.type_name()) + " " + show();
  }

  const json& value_;
  const fs::path& file_;
  std::string pointer_;
};

std::vector<double> readKnots(const Node& node, int numControlPoints, int degree) {
  const size_t size = node.requireArray("numbers");
  const size_t needed = static_cast<size_t>(numControlPoints + degree + 1);
  if (size != needed) {
    node.fail("has " + std::to_string(size) + " knots; " + std::to_string(numControlPoints) +
              " control points of degree " + std::to_string(degree) + " need " + std::to_string(needed));
  }
  std::vector<double> knots;
  for (size_t i = 0; i < size; ++i) {
    knots.push_back(node.at(i).getNumber());
    if (i > 0 && knots[i] < knots[i - 1]) {
      node.at(i).fail("is " + formatNumber(knots[i]) + " after " + formatNumber(knots[i - 1]) +
                      "; knots must not decrease");
    }
  }
  return knots;
}

NamedPatch readPatch(const Node& node, double perMeter) {
  node.requireObject({"name", "degree", "knots_u", "knots_v", "points", "weights", "flip_normal", "comment", "source"});
  NamedPatch patch;
  patch.name = node.at("name").getString();
  if (patch.name.empty()) node.at("name").fail("is empty; every patch needs a name");
  contact::NurbsPatchData& data = patch.data;

  const Node degree = node.at("degree");
  if (degree.requireArray("two integers") != 2) degree.fail("is " + degree.show() + "; allowed: [degree_u, degree_v]");
  data.degreeU = degree.at(size_t{0}).getInteger(1, kMaxDegree);
  data.degreeV = degree.at(size_t{1}).getInteger(1, kMaxDegree);

  const Node points = node.at("points");
  const size_t rows = points.requireArray("rows (along u) of points (along v)");
  if (rows < static_cast<size_t>(data.degreeU) + 1) {
    points.fail("has " + std::to_string(rows) + " rows; degree " + std::to_string(data.degreeU) +
                " along u needs at least " + std::to_string(data.degreeU + 1));
  }
  const size_t columns = points.at(size_t{0}).requireArray("points [x, y, z]");
  if (columns < static_cast<size_t>(data.degreeV) + 1) {
    points.at(size_t{0}).fail("has " + std::to_string(columns) + " points; degree " + std::to_string(data.degreeV) +
                              " along v needs at least " + std::to_string(data.degreeV + 1));
  }
  data.numU = static_cast<int>(rows);
  data.numV = static_cast<int>(columns);
  data.points.reserve(rows * columns);
  for (size_t i = 0; i < rows; ++i) {
    const Node row = points.at(i);
    if (row.requireArray("points [x, y, z]") != columns) {
      row.fail("has " + std::to_string(row.requireArray("points")) + " points where row 0 has " +
               std::to_string(columns));
    }
    for (size_t j = 0; j < columns; ++j) {
      const Node point = row.at(j);
      if (point.requireArray("three numbers") != 3) point.fail("is " + point.show() + "; allowed: [x, y, z]");
      contact::Vec3 p;
      // A quotient by 1000 is rounded once; a product with 0.001, itself rounded, is not.
      for (int k = 0; k < 3; ++k) p[k] = point.at(static_cast<size_t>(k)).getNumber() / perMeter;
      data.points.push_back(p);
    }
  }
  if (node.has("weights")) {
    const Node weights = node.at("weights");
    if (weights.requireArray("rows of numbers") != rows) {
      weights.fail("has " + std::to_string(weights.requireArray("rows")) + " rows where points have " +
                   std::to_string(rows));
    }
    for (size_t i = 0; i < rows; ++i) {
      const Node row = weights.at(i);
      if (row.requireArray("numbers") != columns) {
        row.fail("has " + std::to_string(row.requireArray("numbers")) + " weights where points have " +
                 std::to_string(columns));
      }
      for (size_t j = 0; j < columns; ++j) {
        const double weight = row.at(j).getNumber();
        if (!(weight > 0)) row.at(j).fail("is " + formatNumber(weight) + "; a weight must be > 0");
        data.weights.push_back(weight);
      }
    }
  }
  data.knotsU = readKnots(node.at("knots_u"), data.numU, data.degreeU);
  data.knotsV = readKnots(node.at("knots_v"), data.numV, data.degreeV);
  if (node.has("flip_normal")) data.flipNormal = node.at("flip_normal").getBool();
  try {
    data.validate();
  } catch (const std::invalid_argument& error) {
    node.fail(std::string("patch \"") + patch.name + "\": " + error.what());
  }
  return patch;
}

std::string dumpRow(const contact::NurbsPatchData& data, int row, double perMeter) {
  std::string text = "[";
  for (int j = 0; j < data.numV; ++j) {
    const contact::Vec3& p = data.points[static_cast<size_t>(row * data.numV + j)];
    text += j == 0 ? "[" : ", [";
    for (int k = 0; k < 3; ++k) text += (k == 0 ? "" : ", ") + formatNumber(p[k] * perMeter);
    text += "]";
  }
  return text + "]";
}

std::string dumpNumbers(const double* values, size_t count) {
  std::string text = "[";
  for (size_t i = 0; i < count; ++i) text += (i == 0 ? "" : ", ") + formatNumber(values[i]);
  return text + "]";
}

std::string dumpText(const std::string& text) {
  return json(text).dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

std::vector<NamedPatch> parseNurbs(const std::string& text, const fs::path& path) {
  json document;
  try {
    document = json::parse(text);
  } catch (const json::exception& error) {
    // nlohmann's text begins with "[json.exception.parse_error.101] ".
    const std::string what = error.what();
    const size_t bracket = what.find("] ");
    throw InputError(path.string() +
                     ": not valid JSON: " + (bracket == std::string::npos ? what : what.substr(bracket + 2)));
  }
  const Node root(document, path, "");
  root.requireObject({"format", "version", "length_unit", "patches", "comment", "source"});
  if (root.at("format").getString() != "genu-nurbs") {
    root.at("format").fail("is " + root.at("format").show() + "; allowed: \"genu-nurbs\"");
  }
  root.at("version").getInteger(1, 1);
  const std::string unit = root.at("length_unit").getString();
  if (unit != "mm" && unit != "m") root.at("length_unit").fail("is \"" + unit + "\"; allowed: mm, m");
  const Node list = root.at("patches");
  const size_t count = list.requireArray("patches");
  if (count == 0) list.fail("is empty; at least one patch is needed");
  std::vector<NamedPatch> patches;
  std::set<std::string> names;
  for (size_t i = 0; i < count; ++i) {
    patches.push_back(readPatch(list.at(i), unit == "mm" ? 1000 : 1));
    if (!names.insert(patches.back().name).second) {
      list.at(i).at("name").fail("repeats \"" + patches.back().name + "\"; names of patches must differ");
    }
  }
  return patches;
}

std::vector<NamedPatch> readNurbsFile(const fs::path& path) { return parseNurbs(readFile(path), path); }

void writeNurbsFile(const fs::path& path, const std::vector<NamedPatch>& patches, const std::string& comment) {
  constexpr double kPerMeter = 1000;
  if (patches.empty()) throw std::invalid_argument("writeNurbsFile: no patch");
  std::string text = "{\n  \"format\": \"genu-nurbs\",\n  \"version\": 1,\n  \"length_unit\": \"mm\",\n";
  if (!comment.empty()) text += "  \"comment\": " + dumpText(comment) + ",\n";
  text += "  \"patches\": [";
  for (size_t n = 0; n < patches.size(); ++n) {
    const contact::NurbsPatchData& data = patches[n].data;
    data.validate();
    text += std::string(n == 0 ? "\n" : ",\n") + "    {\n      \"name\": " + dumpText(patches[n].name) +
            ",\n      \"degree\": [" + std::to_string(data.degreeU) + ", " + std::to_string(data.degreeV) +
            "],\n      \"flip_normal\": " + (data.flipNormal ? "true" : "false") +
            ",\n      \"knots_u\": " + dumpNumbers(data.knotsU.data(), data.knotsU.size()) +
            ",\n      \"knots_v\": " + dumpNumbers(data.knotsV.data(), data.knotsV.size()) + ",\n      \"points\": [";
    for (int i = 0; i < data.numU; ++i) text += (i == 0 ? "\n        " : ",\n        ") + dumpRow(data, i, kPerMeter);
    text += "\n      ]";
    if (data.isRational()) {
      text += ",\n      \"weights\": [";
      for (int i = 0; i < data.numU; ++i) {
        const double* row = data.weights.data() + static_cast<size_t>(i) * static_cast<size_t>(data.numV);
        text += (i == 0 ? "\n        " : ",\n        ") + dumpNumbers(row, static_cast<size_t>(data.numV));
      }
      text += "\n      ]";
    }
    text += "\n    }";
  }
  text += "\n  ]\n}\n";
  writeFileAtomically(path, text);
}

}  // namespace genu::io
