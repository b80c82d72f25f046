#include "VtpReader.h"

#include <zlib.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <pugixml.hpp>
#include <string_view>
#include <vector>

#include "genu/io/Units.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

namespace {

using Bytes = std::vector<unsigned char>;

/** Reads one file; every message names it. Format: VTK file formats, version 1.0, "XML file formats". */
class Reader {
 public:
  Reader(const std::string& content, const std::filesystem::path& file) : content_(content), file_(file) {}

  TriangleMesh read() {
    parse();
    TriangleMesh mesh;
    const pugi::xml_node root = document_.child("VTKFile");
    if (!root || std::string_view(root.attribute("type").value()) != "PolyData") {
      fail("not a VTK XML PolyData file (<VTKFile type=\"PolyData\">)");
    }
    if (std::string_view(root.attribute("byte_order").as_string("LittleEndian")) != "LittleEndian") {
      fail("byte_order \"" + std::string(root.attribute("byte_order").value()) +
           "\" is not read; allowed: LittleEndian");
    }
    const std::string_view headerType = root.attribute("header_type").as_string("UInt32");
    if (headerType != "UInt32" && headerType != "UInt64") fail("header_type must be UInt32 or UInt64");
    headerBytes_ = headerType == "UInt64" ? 8 : 4;
    const std::string compressor = root.attribute("compressor").value();
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor") {
      fail("compressor \"" + compressor + "\" is not read; allowed: none, vtkZLibDataCompressor");
    }
    compressed_ = !compressor.empty();
    for (const pugi::xml_node piece : root.child("PolyData").children("Piece")) readPiece(piece, mesh);
    return mesh;
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw InputError("mesh \"" + file_.string() + "\": " + reason);
  }

  void parse() {
    // Raw appended data is not XML: cut it out first.
    std::string xml = content_;
    const size_t tag = content_.find("<AppendedData");
    if (tag != std::string::npos) {
      const size_t open = content_.find('>', tag);
      const size_t mark = open == std::string::npos ? open : content_.find_first_not_of(" \t\r\n", open + 1);
      if (mark == std::string::npos || content_[mark] != '_') fail("truncated: <AppendedData> without data");
      const std::string head = content_.substr(tag, open - tag);
      appendedBase64_ = head.find("base64") != std::string::npos;
      appended_ = std::string_view(content_).substr(mark + 1);
      xml = content_.substr(0, tag) + "</VTKFile>";
    }
    const pugi::xml_parse_result ok = document_.load_buffer(xml.data(), xml.size());
    if (!ok) fail("XML, byte " + std::to_string(ok.offset) + ": " + ok.description());
  }

  void readPiece(const pugi::xml_node& piece, TriangleMesh& mesh) const {
    if (piece.attribute("NumberOfStrips").as_llong() > 0) fail("triangle strips are not read (triangulate it first)");
    const auto points = readArray<double>(piece.child("Points").child("DataArray"), "Points");
    if (points.size() % 3 != 0 || points.size() != 3 * piece.attribute("NumberOfPoints").as_ullong()) {
      fail("Points: " + std::to_string(points.size()) + " numbers for " + piece.attribute("NumberOfPoints").value() +
           " points");
    }
    const pugi::xml_node polys = piece.child("Polys");
    const unsigned long long count = piece.attribute("NumberOfPolys").as_ullong();
    if (count == 0) return;
    const auto connectivity = readArray<std::int64_t>(
        polys.find_child_by_attribute("DataArray", "Name", "connectivity"), "Polys connectivity");
    const auto offsets =
        readArray<std::int64_t>(polys.find_child_by_attribute("DataArray", "Name", "offsets"), "Polys offsets");
    if (offsets.size() != count)
      fail("Polys: " + std::to_string(offsets.size()) + " offsets for " + std::to_string(count) + " polygons");
    const int first = mesh.numVertices();
    const auto numPoints = static_cast<std::int64_t>(points.size() / 3);
    for (size_t i = 0; i < points.size(); i += 3) mesh.vertices.emplace_back(points[i], points[i + 1], points[i + 2]);
    std::int64_t begin = 0;
    for (size_t p = 0; p < offsets.size(); ++p) {
      const std::int64_t corners = offsets[p] - begin;
      if (corners != 3) {
        fail("polygon " + std::to_string(p + 1) + " has " + std::to_string(corners) +
             " corners; only triangles are read (triangulate it first)");
      }
      if (offsets[p] > static_cast<std::int64_t>(connectivity.size()))
        fail("Polys: offsets go beyond the connectivity");
      std::array<int, 3> triangle{};
      for (size_t k = 0; k < 3; ++k) {
        const std::int64_t i = connectivity[static_cast<size_t>(begin) + k];
        if (i < 0 || i >= numPoints) {
          fail("polygon " + std::to_string(p + 1) + " uses point " + std::to_string(i) + " of " +
               std::to_string(numPoints));
        }
        triangle[k] = first + static_cast<int>(i);
      }
      mesh.triangles.push_back(triangle);
      begin = offsets[p];
    }
  }

  template <class T>
  std::vector<T> readArray(const pugi::xml_node& node, const std::string& what) const {
    if (!node) fail(what + ": no <DataArray>");
    const std::string format = node.attribute("format").as_string("ascii");
    const std::string type = node.attribute("type").value();
    if (format == "ascii") return parseAscii<T>(node.text().get(), what);
    Bytes bytes;
    if (format == "binary") {
      bytes = decodeBase64Block(node.text().get(), what);
    } else if (format == "appended") {
      const unsigned long long offset =
          node.attribute("offset").as_ullong(std::numeric_limits<unsigned long long>::max());
      if (offset >= appended_.size()) fail(what + ": truncated: offset beyond the appended data");
      const std::string_view data = appended_.substr(offset);
      bytes = appendedBase64_ ? decodeBase64Block(data, what) : decodeRawBlock(data, what);
    } else {
      fail(what + ": format \"" + format + "\" is not read; allowed: ascii, binary, appended");
    }
    if (type == "Float32") return convert<float, T>(bytes, what);
    if (type == "Float64") return convert<double, T>(bytes, what);
    if (type == "Int32") return convert<std::int32_t, T>(bytes, what);
    if (type == "UInt32") return convert<std::uint32_t, T>(bytes, what);
    if (type == "Int64" || type == "UInt64") return convert<std::int64_t, T>(bytes, what);
    fail(what + ": type \"" + type + "\" is not read; allowed: Float32, Float64, Int32, UInt32, Int64, UInt64");
  }

  template <class T>
  std::vector<T> parseAscii(std::string_view text, const std::string& what) const {
    std::vector<T> values;
    size_t at = 0;
    while ((at = text.find_first_not_of(" \t\r\n", at)) != std::string_view::npos) {
      const size_t end = std::min(text.find_first_of(" \t\r\n", at), text.size());
      values.push_back(static_cast<T>(
          io::parseNumber(std::string(text.substr(at, end - at)), "mesh \"" + file_.string() + "\": " + what)));
      at = end;
    }
    return values;
  }

  template <class From, class To>
  std::vector<To> convert(const Bytes& bytes, const std::string& what) const {
    if (bytes.size() % sizeof(From) != 0)
      fail(what + ": " + std::to_string(bytes.size()) + " bytes are no whole number of values");
    std::vector<To> values(bytes.size() / sizeof(From));
    for (size_t i = 0; i < values.size(); ++i) {
      From value;
      std::memcpy(&value, bytes.data() + i * sizeof(From), sizeof(From));
      values[i] = static_cast<To>(value);
    }
    return values;
  }

  std::uint64_t readHeader(const unsigned char* at) const {
    std::uint64_t value = 0;
    for (size_t i = 0; i < headerBytes_; ++i) value |= static_cast<std::uint64_t>(at[i]) << 8 * i;
    return value;
  }

  /** Sizes announced at the head of a block: uncompressed {bytes}; zlib {blocks, block size, last block size,
   compressed sizes...}. `numWords` is how many words the head has in all once its first word is known. */
  size_t countHeaderWords(std::uint64_t firstWord) const {
    return compressed_ ? 3 + static_cast<size_t>(firstWord) : 1;
  }

  std::uint64_t calcPayload(const std::vector<std::uint64_t>& header) const {
    if (!compressed_) return header[0];
    std::uint64_t sum = 0;
    for (size_t i = 3; i < header.size(); ++i) sum += header[i];
    return sum;
  }

  std::vector<std::uint64_t> unpackHeader(const Bytes& bytes, size_t words) const {
    std::vector<std::uint64_t> header(words);
    for (size_t i = 0; i < words; ++i) header[i] = readHeader(bytes.data() + i * headerBytes_);
    return header;
  }

  Bytes decodeRawBlock(std::string_view data, const std::string& what) const {
    const auto take = [&](size_t begin, std::uint64_t count) {
      if (begin > data.size() || count > data.size() - begin) fail(what + ": truncated");
      return Bytes(data.begin() + static_cast<std::ptrdiff_t>(begin),
                   data.begin() + static_cast<std::ptrdiff_t>(begin + count));
    };
    const size_t words = checkWords(countHeaderWords(readHeader(take(0, headerBytes_).data())), what);
    const auto header = unpackHeader(take(0, words * headerBytes_), words);
    return inflate(header, take(words * headerBytes_, calcPayload(header)), what);
  }

  /** In base64 the head of a compressed block is encoded on its own; an uncompressed one runs into its data. */
  Bytes decodeBase64Block(std::string_view text, const std::string& what) const {
    text = text.substr(std::min(text.find_first_not_of(" \t\r\n"), text.size()));
    const auto encoded = [](std::uint64_t bytes) { return (bytes + 2) / 3 * 4; };
    const auto decode = [&](size_t begin, std::uint64_t bytes) {
      if (begin > text.size() || encoded(bytes) > text.size() - begin) fail(what + ": truncated");
      Bytes out = decodeBase64(text.substr(begin, encoded(bytes)), what);
      if (out.size() < bytes) fail(what + ": truncated");
      out.resize(bytes);
      return out;
    };
    const std::uint64_t first = readHeader(decode(0, headerBytes_).data());
    const size_t words = checkWords(countHeaderWords(first), what);
    const std::uint64_t headBytes = words * headerBytes_;
    const auto header = unpackHeader(decode(0, headBytes), words);
    if (compressed_) return inflate(header, decode(encoded(headBytes), calcPayload(header)), what);
    if (header[0] > text.size()) fail(what + ": truncated");
    Bytes all = decode(0, headBytes + header[0]);
    all.erase(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(headBytes));
    return all;
  }

  size_t checkWords(size_t words, const std::string& what) const {
    if (words > content_.size()) fail(what + ": the head of its data announces more blocks than the file holds");
    return words;
  }

  Bytes decodeBase64(std::string_view text, const std::string& what) const {
    static constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    Bytes out;
    out.reserve(text.size() / 4 * 3);
    std::uint32_t bits = 0;
    int count = 0;
    for (const char c : text) {
      if (c == '=') break;
      const size_t value = alphabet.find(c);
      if (value == std::string_view::npos) fail(what + ": not base64");
      bits = (bits << 6) | static_cast<std::uint32_t>(value);
      count += 6;
      if (count >= 8) {
        count -= 8;
        out.push_back(static_cast<unsigned char>((bits >> count) & 0xff));
      }
    }
    return out;
  }

  Bytes inflate(const std::vector<std::uint64_t>& header, Bytes data, const std::string& what) const {
    if (!compressed_) return data;
    const std::uint64_t blocks = header[0], blockSize = header[1], lastSize = header[2];
    Bytes out;
    size_t at = 0;
    for (std::uint64_t b = 0; b < blocks; ++b) {
      const std::uint64_t size = b + 1 == blocks && lastSize > 0 ? lastSize : blockSize;
      // deflate expands at most 1032 times: anything larger is a broken head, not data
      if (size > 1100 * header[3 + b] + 1100) fail(what + ": zlib block " + std::to_string(b) + " is broken");
      Bytes block(size);
      uLongf written = static_cast<uLongf>(size);
      if (uncompress(block.data(), &written, data.data() + at, static_cast<uLong>(header[3 + b])) != Z_OK ||
          written != size) {
        fail(what + ": zlib block " + std::to_string(b) + " is broken");
      }
      out.insert(out.end(), block.begin(), block.end());
      at += header[3 + b];
    }
    return out;
  }

  const std::string& content_;
  const std::filesystem::path& file_;
  pugi::xml_document document_;
  std::string_view appended_;
  bool appendedBase64_ = false, compressed_ = false;
  size_t headerBytes_ = 4;
};

}  // namespace

TriangleMesh readVtp(const std::string& content, const std::filesystem::path& file) {
  return Reader(content, file).read();
}

}  // namespace genu::fit
