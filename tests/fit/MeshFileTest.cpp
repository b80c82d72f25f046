#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "SampleMeshes.h"
#include "genu/fit/MeshFile.h"
#include "genu/report/Vtk.h"
#include "genu/scene/Scene.h"

namespace genu::fit {
namespace {

using test::messageOf;
using test::TemporaryFolder;
using test::writeText;
using testing::HasSubstr;

/** 8 x 6 cells in mm, heights in 1/64 mm: every coordinate is exact in single precision and in short decimals. */
TriangleMesh makeMillimetreSheet() {
  return test::makeSheet(16, 12, 8, 6, [](double x, double z) { return std::round((x * x + z) * 4) / 64; });
}

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

std::string toBinaryStl(const TriangleMesh& mesh) {
  std::string bytes(80, ' ');
  append<std::uint32_t>(bytes, static_cast<std::uint32_t>(mesh.numTriangles()));
  for (int t = 0; t < mesh.numTriangles(); ++t) {
    const Vec3 n = mesh.calcAreaVector(t).normalized();
    for (int k = 0; k < 3; ++k) append(bytes, static_cast<float>(n[k]));
    for (const int i : mesh.triangles[static_cast<size_t>(t)]) {
      for (int k = 0; k < 3; ++k) append(bytes, static_cast<float>(mesh.vertices[static_cast<size_t>(i)][k]));
    }
    append<std::uint16_t>(bytes, 0);
  }
  return bytes;
}

std::string toAsciiStl(const TriangleMesh& mesh) {
  std::ostringstream out;
  out.precision(9);
  out << "solid sheet\n";
  for (const auto& t : mesh.triangles) {
    out << "facet normal 0 1 0\nouter loop\n";
    for (const int i : t) {
      const Vec3& p = mesh.vertices[static_cast<size_t>(i)];
      out << "vertex " << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
    }
    out << "endloop\nendfacet\n";
  }
  out << "endsolid sheet\n";
  return out.str();
}

std::string pointsBytes(const TriangleMesh& mesh) {
  std::string bytes;
  for (const Vec3& p : mesh.vertices) {
    for (int k = 0; k < 3; ++k) append(bytes, p[k]);
  }
  return bytes;
}
std::string connectivityBytes(const TriangleMesh& mesh) {
  std::string bytes;
  for (const auto& t : mesh.triangles) {
    for (const int i : t) append<std::int32_t>(bytes, i);
  }
  return bytes;
}
std::string offsetsBytes(const TriangleMesh& mesh) {
  std::string bytes;
  for (int t = 1; t <= mesh.numTriangles(); ++t) append<std::int32_t>(bytes, 3 * t);
  return bytes;
}

std::string toBase64(const std::string& bytes) {
  static const char* alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    const size_t n = std::min<size_t>(3, bytes.size() - i);
    for (size_t k = 0; k < 3; ++k) word = (word << 8) | (k < n ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) out += k <= n ? alphabet[(word >> (18 - 6 * k)) & 63] : '=';
  }
  return out;
}

std::string toVtp(const TriangleMesh& mesh, const std::string& rootAttributes, const std::string& arrayAttributes,
                  const std::vector<std::string>& content, const std::string& tail = {}) {
  const auto array = [&](const std::string& type, const std::string& name, size_t k, int components) {
    std::string attributes = arrayAttributes;
    if (attributes.find("appended") != std::string::npos) attributes += " offset=\"" + content[k] + "\"";
    return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" + std::to_string(components) +
           "\" " + attributes + ">" + (tail.empty() ? content[k] : "") + "</DataArray>\n";
  };
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" " +
         rootAttributes + "><PolyData><Piece NumberOfPoints=\"" + std::to_string(mesh.numVertices()) +
         "\" NumberOfPolys=\"" + std::to_string(mesh.numTriangles()) + "\">\n<Points>" +
         array("Float64", "Points", 0, 3) + "</Points>\n<Polys>" + array("Int32", "connectivity", 1, 1) +
         array("Int32", "offsets", 2, 1) + "</Polys></Piece></PolyData>\n" + tail + "</VTKFile>\n";
}

std::string sized(const std::string& bytes) {
  std::string out;
  append<std::uint64_t>(out, bytes.size());
  return out + bytes;
}

std::string compressInBase64(const std::string& bytes) {
  constexpr size_t blockSize = 256;
  const size_t blocks = (bytes.size() + blockSize - 1) / blockSize;
  std::string head, body;
  append<std::uint64_t>(head, blocks);
  append<std::uint64_t>(head, blockSize);
  append<std::uint64_t>(head, bytes.size() % blockSize);
  for (size_t b = 0; b < blocks; ++b) {
    const std::string block = bytes.substr(b * blockSize, blockSize);
    uLongf size = compressBound(static_cast<uLong>(block.size()));
    std::vector<Bytef> out(size);
    compress(out.data(), &size, reinterpret_cast<const Bytef*>(block.data()), static_cast<uLong>(block.size()));
    append<std::uint64_t>(head, size);
    body.append(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(size));
  }
  return toBase64(head) + toBase64(body);
}

void expectSame(const MeshFile& file, const TriangleMesh& mm, const std::string& what) {
  SCOPED_TRACE(what);
  EXPECT_EQ(file.info.unit, LengthUnit::mm);
  ASSERT_EQ(file.mesh.numVertices(), mm.numVertices());
  ASSERT_EQ(file.mesh.numTriangles(), mm.numTriangles());
  // Same triangles in the same order, whatever the numbering of the vertices; mm to m is one rounded division.
  for (size_t t = 0; t < mm.triangles.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      const Vec3& a = file.mesh.vertices[static_cast<size_t>(file.mesh.triangles[t][k])];
      const Vec3 b = mm.vertices[static_cast<size_t>(mm.triangles[t][k])] / 1000;
      ASSERT_EQ(a, b) << "triangle " << t;
    }
  }
}

TEST(MeshFile, AllFormatsGiveTheSameMesh) {
  const TriangleMesh mesh = makeMillimetreSheet();
  const TemporaryFolder folder;
  const auto read = [&](const std::string& name, const std::string& text) {
    writeText(folder / name, text);
    return readMeshFile(folder / name);
  };
  expectSame(read("a.stl", toBinaryStl(mesh)), mesh, "binary STL");
  expectSame(read("b.STL", toAsciiStl(mesh)), mesh, "ASCII STL");
  std::string solidHeader = toBinaryStl(mesh);
  solidHeader.replace(0, 5, "solid");  // some programs begin binary files so
  expectSame(read("c.stl", solidHeader), mesh, "binary STL that begins with solid");
  expectSame(read("d.obj", test::toObj(mesh, 1)), mesh, "OBJ");

  std::ostringstream points, connectivity, offsets;
  points.precision(17);
  for (const Vec3& p : mesh.vertices) points << p.x() << ' ' << p.y() << "\n " << p.z() << ' ';
  for (const auto& t : mesh.triangles) connectivity << t[0] << ' ' << t[1] << ' ' << t[2] << '\n';
  for (int t = 1; t <= mesh.numTriangles(); ++t) offsets << 3 * t << ' ';
  expectSame(read("e.vtp", toVtp(mesh, "", "format=\"ascii\"", {points.str(), connectivity.str(), offsets.str()})),
             mesh, "VTP ascii");

  const std::string p = pointsBytes(mesh), c = connectivityBytes(mesh), o = offsetsBytes(mesh);
  expectSame(read("f.vtp", toVtp(mesh, "header_type=\"UInt64\"", "format=\"binary\"",
                                 {toBase64(sized(p)), toBase64(sized(c)), toBase64(sized(o))})),
             mesh, "VTP inline base64");
  expectSame(read("g.vtp", toVtp(mesh, "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"",
                                 "format=\"binary\"", {compressInBase64(p), compressInBase64(c), compressInBase64(o)})),
             mesh, "VTP inline zlib");
  expectSame(
      read("h.vtp", toVtp(mesh, "header_type=\"UInt64\"", "format=\"appended\"",
                          {"0", std::to_string(p.size() + 8), std::to_string(p.size() + c.size() + 16)},
                          "<AppendedData encoding=\"raw\">\n_" + sized(p) + sized(c) + sized(o) + "\n</AppendedData>")),
      mesh, "VTP appended raw");

  report::VtkMesh vtk;
  vtk.cornersPerCell = 3;
  for (const Vec3& v : mesh.vertices) vtk.points.insert(vtk.points.end(), {v.x(), v.y(), v.z()});
  for (const auto& t : mesh.triangles) vtk.connectivity.insert(vtk.connectivity.end(), t.begin(), t.end());
  report::writeVtp(folder / "i.vtp", vtk);
  expectSame(readMeshFile(folder / "i.vtp"), mesh, "VTP as Genu writes it (appended base64)");
}

TEST(MeshFile, GuessesTheUnitFromTheSizeAndSaysSo) {
  const TriangleMesh mesh = makeMillimetreSheet();
  const TemporaryFolder folder;
  writeText(folder / "mm.obj", test::toObj(mesh, 1));
  writeText(folder / "m.obj", test::toObj(mesh, 1e-3));
  writeText(folder / "km.obj", test::toObj(mesh, 1e5));
  const MeshFile mm = readMeshFile(folder / "mm.obj"), m = readMeshFile(folder / "m.obj");
  EXPECT_EQ(mm.info.unit, LengthUnit::mm);
  EXPECT_EQ(m.info.unit, LengthUnit::m);
  EXPECT_TRUE(mm.info.unitGuessed);
  EXPECT_FALSE(readMeshFile(folder / "m.obj", LengthUnit::m).info.unitGuessed);
  // single precision of assimp: 6e-8 relative of 16 mm
  EXPECT_NEAR(mm.mesh.calcBoundingBox().max().x(), m.mesh.calcBoundingBox().max().x(), 1e-9);
  EXPECT_THAT(messageOf<InputError>([&] { readMeshFile(folder / "km.obj"); }), HasSubstr("neither in m nor in mm"));
}

TEST(MeshFile, RefusesAKneeOfSeventyMetres) {
  const TemporaryFolder folder;
  writeText(folder / "mm.obj", test::toObj(makeMillimetreSheet(), 2));
  const std::string said = messageOf<InputError>([&] { readMeshFile(folder / "mm.obj", LengthUnit::m); });
  EXPECT_THAT(said, HasSubstr("mm.obj"));
  EXPECT_THAT(said, HasSubstr("1 mm to 2 m"));
  EXPECT_THAT(said, HasSubstr("--unit mm"));
  writeText(folder / "m.obj", test::toObj(makeMillimetreSheet(), 1e-3));
  EXPECT_THAT(messageOf<InputError>([&] { readMeshFile(folder / "m.obj", LengthUnit::mm); }), HasSubstr("--unit m"));
}

TEST(MeshFile, NamesWhatIsWrongWithAFile) {
  const TriangleMesh mesh = makeMillimetreSheet();
  const TemporaryFolder folder;
  const auto message = [&](const std::string& name, const std::string& text) {
    writeText(folder / name, text);
    return messageOf<InputError>([&] { readMeshFile(folder / name); });
  };
  const std::string stl = toBinaryStl(mesh);
  EXPECT_THAT(message("cut.stl", stl.substr(0, stl.size() - 77)), HasSubstr("truncated"));
  EXPECT_THAT(message("short.stl", stl.substr(0, 40)), HasSubstr("84 bytes"));
  EXPECT_THAT(message("cut_ascii.stl", toAsciiStl(mesh).substr(0, 900)), HasSubstr("truncated"));
  EXPECT_THAT(message("none.stl", stl.substr(0, 80) + std::string(4, '\0')), HasSubstr("none.stl"));
  EXPECT_THAT(message("empty.obj", ""), HasSubstr("empty.obj"));
  EXPECT_THAT(message("quad.obj", "v 0 0 0\nv 9 0 0\nv 9 0 9\nv 0 0 9\nf 1 2 3 4\n"),
              HasSubstr("only triangles are read"));
  TriangleMesh bad = mesh;
  bad.vertices[5].y() = std::nan("");
  EXPECT_THAT(message("nan.stl", toBinaryStl(bad)), HasSubstr("not finite"));
  EXPECT_THAT(message("mesh.ply", "ply"), HasSubstr("allowed: .stl, .obj, .vtp"));
  EXPECT_THAT(messageOf<InputError>([&] { readMeshFile(folder / "absent.stl"); }), HasSubstr("absent.stl"));

  const auto vtp = [&](const std::string& name, const std::vector<std::string>& content, const std::string& root = "") {
    return message(name, toVtp(mesh, root, "format=\"binary\"", content));
  };
  const std::string p = toBase64(sized(pointsBytes(mesh))), c = toBase64(sized(connectivityBytes(mesh))),
                    o = toBase64(sized(offsetsBytes(mesh))), u64 = "header_type=\"UInt64\"";
  EXPECT_THAT(vtp("cut.vtp", {p.substr(0, p.size() / 2), c, o}, u64), HasSubstr("truncated"));
  EXPECT_THAT(vtp("head.vtp", {p, c, o}, "header_type=\"UInt8\""), HasSubstr("header_type"));
  EXPECT_THAT(vtp("lz4.vtp", {p, c, o}, "compressor=\"vtkLZ4DataCompressor\""), HasSubstr("vtkLZ4DataCompressor"));
  EXPECT_THAT(vtp("junk.vtp", {"@@@@@@@@@@@@@@@@@@@@", c, o}, u64), HasSubstr("base64"));
  EXPECT_THAT(message("xml.vtp", "<VTKFile type=\"PolyData\"><PolyData>"), HasSubstr("XML"));
  std::string far;
  for (int i = 0; i < 3 * mesh.numTriangles(); ++i) append<std::int32_t>(far, 7777);
  EXPECT_THAT(vtp("far.vtp", {p, toBase64(sized(far)), o}, u64), HasSubstr("uses point 7777 of 63"));
}

}  // namespace
}  // namespace genu::fit
