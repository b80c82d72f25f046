#include "genu/report/Vtk.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <numeric>
#include <pugixml.hpp>
#include <sstream>
#include <stdexcept>

#include "genu/io/Files.h"
#include "genu/scene/Scene.h"

namespace genu::report {
namespace fs = std::filesystem;

namespace {

static_assert(sizeof(float) == 4 && sizeof(double) == 8, "VTK's Float32 and Float64");

struct Block {
  const unsigned char* data;
  std::uint64_t bytes;
};

/** Base64 (RFC 4648) of consecutive pieces of bytes as one stream. */
class Base64Writer {
 public:
  explicit Base64Writer(std::ostream& out) : out_(out) {}
  void write(const unsigned char* data, std::uint64_t bytes) {
    for (std::uint64_t i = 0; i < bytes; ++i) {
      group_[filled_++] = data[i];
      if (filled_ < 3) continue;
      if (buffer_.size() > 65000) flushBuffer();
      flushGroup();
    }
  }
  void finish() {
    if (filled_ > 0) {
      const size_t used = filled_;
      std::fill(group_.begin() + static_cast<std::ptrdiff_t>(used), group_.end(), static_cast<unsigned char>(0));
      flushGroup();
      for (size_t i = used; i < 3; ++i) buffer_[buffer_.size() - 1 - (i - used)] = '=';
    }
    flushBuffer();
  }

 private:
  void flushGroup() {
    static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const unsigned bits = (unsigned{group_[0]} << 16) | (unsigned{group_[1]} << 8) | group_[2];
    for (int shift = 18; shift >= 0; shift -= 6) buffer_.push_back(kDigits[(bits >> shift) & 63]);
    filled_ = 0;
  }
  void flushBuffer() {
    out_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    buffer_.clear();
  }

  std::ostream& out_;
  std::array<unsigned char, 3> group_{};
  size_t filled_ = 0;
  std::string buffer_;
};

/** Appends arrays to the header and remembers their bytes. An appended block is its byte count (UInt64) and the bytes,
 encoded together; offsets count characters of base64. */
class ArrayCollector {
 public:
  template <class T>
  pugi::xml_node add(pugi::xml_node parent, const char* type, const std::string& name, int components,
                     const std::vector<T>& values) {
    pugi::xml_node node = parent.append_child("DataArray");
    node.append_attribute("type") = type;
    node.append_attribute("Name") = name.c_str();
    node.append_attribute("NumberOfComponents") = components;
    node.append_attribute("format") = "appended";
    node.append_attribute("offset") = static_cast<unsigned long long>(offset_);
    const std::uint64_t bytes = values.size() * sizeof(T);
    blocks_.push_back({reinterpret_cast<const unsigned char*>(values.data()), bytes});
    offset_ += (bytes + sizeof(std::uint64_t) + 2) / 3 * 4;
    return node;
  }
  const std::vector<Block>& blocks() const { return blocks_; }

 private:
  std::vector<Block> blocks_;
  std::uint64_t offset_ = 0;
};

pugi::xml_node addArray(ArrayCollector& collector, pugi::xml_node parent, const VtkArray& array,
                        size_t expectedTuples) {
  pugi::xml_node node;
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if (array.components < 1 || values.size() != expectedTuples * static_cast<size_t>(array.components)) {
          throw std::invalid_argument(fmt::format("VTK array \"{}\": {} values where {} x {} are needed", array.name,
                                                  values.size(), expectedTuples, array.components));
        }
        const char* type = std::is_same_v<T, double>         ? "Float64"
                           : std::is_same_v<T, float>        ? "Float32"
                           : std::is_same_v<T, std::int32_t> ? "Int32"
                                                             : "UInt8";
        node = collector.add(parent, type, array.name, array.components, values);
      },
      array.values);
  return node;
}

}  // namespace

void writeVtp(const fs::path& file, const VtkMesh& mesh) {
  const bool lines = !mesh.lineEnds.empty();
  std::vector<std::int32_t> offsets = mesh.lineEnds, connectivity = mesh.connectivity;
  if (lines) {
    connectivity.resize(mesh.numPoints());
    std::iota(connectivity.begin(), connectivity.end(), 0);
  } else {
    offsets.resize(mesh.numCells());
    for (size_t i = 0; i < offsets.size(); ++i) offsets[i] = static_cast<std::int32_t>((i + 1)) * mesh.cornersPerCell;
  }

  pugi::xml_document document;
  pugi::xml_node root = document.append_child("VTKFile");
  root.append_attribute("type") = "PolyData";
  root.append_attribute("version") = "1.0";
  root.append_attribute("byte_order") = "LittleEndian";
  root.append_attribute("header_type") = "UInt64";
  pugi::xml_node polyData = root.append_child("PolyData");
  ArrayCollector collector;
  if (!mesh.fieldData.empty()) {
    pugi::xml_node fieldData = polyData.append_child("FieldData");
    for (const auto& array : mesh.fieldData) {
      const size_t size = std::visit([](const auto& values) { return values.size(); }, array.values);
      pugi::xml_node node = addArray(collector, fieldData, array, size / static_cast<size_t>(array.components));
      node.append_attribute("NumberOfTuples") = static_cast<unsigned long long>(size) / array.components;
    }
  }
  pugi::xml_node piece = polyData.append_child("Piece");
  piece.append_attribute("NumberOfPoints") = static_cast<unsigned long long>(mesh.numPoints());
  piece.append_attribute("NumberOfVerts") = 0;
  piece.append_attribute("NumberOfLines") = static_cast<unsigned long long>(lines ? mesh.numCells() : 0);
  piece.append_attribute("NumberOfStrips") = 0;
  piece.append_attribute("NumberOfPolys") = static_cast<unsigned long long>(lines ? 0 : mesh.numCells());
  pugi::xml_node pointData = piece.append_child("PointData");
  for (const auto& array : mesh.pointData) addArray(collector, pointData, array, mesh.numPoints());
  pugi::xml_node cellData = piece.append_child("CellData");
  for (const auto& array : mesh.cellData) addArray(collector, cellData, array, mesh.numCells());
  if (!mesh.cellData.empty()) cellData.append_attribute("Scalars") = mesh.cellData.front().name.c_str();
  collector.add(piece.append_child("Points"), "Float64", "Points", 3, mesh.points);
  pugi::xml_node cells = piece.append_child(lines ? "Lines" : "Polys");
  collector.add(cells, "Int32", "connectivity", 1, connectivity);
  collector.add(cells, "Int32", "offsets", 1, offsets);

  pugi::xml_node appended = root.append_child("AppendedData");
  appended.append_attribute("encoding") = "base64";
  static constexpr char kMarker[] = "_genu_appended_data_";
  appended.append_child(pugi::node_pcdata).set_value(kMarker);

  std::ostringstream header;
  document.save(header, "  ", pugi::format_indent);
  const std::string text = header.str();
  const size_t marker = text.rfind(kMarker);

  fs::path temporary = file;
  temporary += ".part";
  {
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    out.write(text.data(), static_cast<std::streamsize>(marker));
    out << '_';
    for (const Block& block : collector.blocks()) {
      Base64Writer writer(out);
      writer.write(reinterpret_cast<const unsigned char*>(&block.bytes), sizeof(block.bytes));
      writer.write(block.data, block.bytes);
      writer.finish();
    }
    out << text.substr(marker + sizeof(kMarker) - 1);
    out.close();
    if (!out) {
      const std::string reason = std::strerror(errno);
      std::error_code ignored;
      fs::remove(temporary, ignored);
      throw InputError("\"" + file.string() + "\": cannot be written: " + reason);
    }
  }
  fs::rename(temporary, file);
}

void writePvd(const fs::path& file, const std::vector<std::pair<double, std::string>>& frames) {
  pugi::xml_document document;
  pugi::xml_node root = document.append_child("VTKFile");
  root.append_attribute("type") = "Collection";
  root.append_attribute("version") = "1.0";
  root.append_attribute("byte_order") = "LittleEndian";
  pugi::xml_node collection = root.append_child("Collection");
  std::map<double, int> parts;  // several files may share a time
  for (const auto& [time, name] : frames) {
    pugi::xml_node node = collection.append_child("DataSet");
    node.append_attribute("timestep") = fmt::format("{}", time).c_str();
    node.append_attribute("group") = "";
    node.append_attribute("part") = parts[time]++;
    node.append_attribute("file") = name.c_str();
  }
  std::ostringstream out;
  document.save(out, "  ");
  io::writeFileAtomically(file, out.str());
}

}  // namespace genu::report
