#include "genu/report/ElementMesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "genu/scene/Scene.h"

namespace genu::report {
namespace fs = std::filesystem;
using contact::CompartmentDefinition;
using contact::ElementField;
using contact::Vec3;

namespace {

/** Shared corners of one compartment: index of the point at grid corner (i, k), places on the rays averaged over elements.
 `X_FG`: pose of the body that carries the grid. */
void appendCompartment(const CompartmentDefinition& compartment, const std::vector<ElementField>& elements,
                       const contact::Pose& X_FG, VtkMesh& mesh) {
  const contact::ElementRays rays(compartment);
  int finest = 0;
  for (const auto& e : elements) finest = std::max(finest, e.level);
  // Corners are counted in cells of the finest level, in order of the first coordinate, then the second.
  struct Corner {
    double along = 0;
    int count = 0;
    std::int32_t index = -1;
  };
  std::map<std::pair<int, int>, Corner> corners;
  const auto place = [&](const ElementField& e, int i, int k) {
    const int shift = finest - e.level;
    std::pair<int, int> at{(e.ix + i) << shift, (e.iz + k) << shift};
    if (rays.wraps() && at.first == compartment.nx << finest) at.first = 0;  // one corner on both sides of the seam
    return at;
  };
  const auto rayOf = [&](std::pair<int, int> at) {
    const double a = rays.a0() + std::ldexp(at.first, -finest) * rays.da(), b = rays.b0() + std::ldexp(at.second, -finest) * rays.db();
    return std::pair(rays.calcOrigin(a, b), rays.calcDirection(a, b));
  };
  for (const auto& e : elements) {
    const Vec3 p_GA = X_FG.applyInverse(e.p_FA), normal_G = X_FG.R.transpose() * e.normal_F;
    for (int i = 0; i < 2; ++i) {
      for (int k = 0; k < 2; ++k) {
        const auto at = place(e, i, k);
        const auto [origin, direction] = rayOf(at);
        Corner& corner = corners[at];
        corner.along += normal_G.dot(p_GA - origin) / normal_G.dot(direction);
        ++corner.count;
      }
    }
  }
  for (auto& [at, corner] : corners) {
    corner.index = static_cast<std::int32_t>(mesh.numPoints());
    const auto [origin, direction] = rayOf(at);
    const Vec3 point = X_FG.apply(origin + corner.along / corner.count * direction);
    mesh.points.insert(mesh.points.end(), {point.x(), point.y(), point.z()});
  }
  const auto pointAt = [&mesh](std::int32_t i) { return Vec3(Eigen::Map<const Vec3>(mesh.points.data() + 3 * static_cast<size_t>(i))); };
  for (const auto& e : elements) {
    // Counter-clockwise seen from outside: the face normal is the outward normal of the surface.
    std::array<std::int32_t, 4> quad{};
    const std::pair<int, int> around[4] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
    for (size_t c = 0; c < 4; ++c) quad[c] = corners.at(place(e, around[c].first, around[c].second)).index;
    const Vec3 faceNormal = (pointAt(quad[2]) - pointAt(quad[0])).cross(pointAt(quad[3]) - pointAt(quad[1]));
    if (faceNormal.dot(e.normal_F) < 0) std::swap(quad[1], quad[3]);
    mesh.connectivity.insert(mesh.connectivity.end(), quad.begin(), quad.end());
  }
}

template <class T, class Getter>
VtkArray makeArray(const std::string& name, int components, const std::vector<std::vector<ElementField>>& fields,
                   Getter getter) {
  std::vector<T> values;
  for (size_t c = 0; c < fields.size(); ++c) {
    for (const auto& e : fields[c]) {
      if constexpr (std::is_same_v<std::decay_t<decltype(getter(e, c))>, Vec3>) {
        const Vec3 v = getter(e, c);
        values.insert(values.end(), {static_cast<T>(v.x()), static_cast<T>(v.y()), static_cast<T>(v.z())});
      } else {
        values.push_back(static_cast<T>(getter(e, c)));
      }
    }
  }
  return {name, components, std::move(values)};
}

template <class Real>
void addCellData(const std::vector<std::vector<ElementField>>& fields, bool full, VtkMesh& mesh) {
  auto& data = mesh.cellData;
  data.push_back(makeArray<Real>("pressure_Pa", 1, fields, [](const ElementField& e, size_t) { return e.p_Pa; }));
  data.push_back(makeArray<Real>("penetration_m", 1, fields, [](const ElementField& e, size_t) { return e.d_m; }));
  data.push_back(makeArray<Real>("thickness_m", 1, fields, [](const ElementField& e, size_t) { return e.h_m; }));
  data.push_back(makeArray<Real>("distance_m", 1, fields, [](const ElementField& e, size_t) { return e.distance_m; }));
  data.push_back(makeArray<Real>("contact_share", 1, fields, [](const ElementField& e, size_t) { return e.contactShare; }));
  data.push_back(makeArray<Real>("force_N", 1, fields, [](const ElementField& e, size_t) { return e.force_N; }));
  data.push_back(makeArray<Real>("area_m2", 1, fields, [](const ElementField& e, size_t) { return e.area_m2; }));
  data.push_back(
      makeArray<std::uint8_t>("contact", 1, fields, [](const ElementField& e, size_t) { return e.active ? 1 : 0; }));
  data.push_back(
      makeArray<std::uint8_t>("unresolved", 1, fields, [](const ElementField& e, size_t) { return e.unresolved ? 1 : 0; }));
  data.push_back(makeArray<std::uint8_t>("compartment", 1, fields,
                                         [](const ElementField&, size_t c) { return static_cast<int>(c); }));
  data.push_back(makeArray<std::int32_t>("ix", 1, fields, [](const ElementField& e, size_t) { return e.ix; }));
  data.push_back(makeArray<std::int32_t>("iz", 1, fields, [](const ElementField& e, size_t) { return e.iz; }));
  data.push_back(makeArray<std::int32_t>("level", 1, fields, [](const ElementField& e, size_t) { return e.level; }));
  if (!full) return;
  data.push_back(makeArray<Real>("center_m", 3, fields, [](const ElementField& e, size_t) -> Vec3 { return e.p_FA; }));
  data.push_back(
      makeArray<Real>("normal", 3, fields, [](const ElementField& e, size_t) -> Vec3 { return e.normal_F; }));
  data.push_back(makeArray<Real>("force_direction", 3, fields,
                                 [](const ElementField& e, size_t) -> Vec3 { return e.forceDirection_F; }));
}

}  // namespace

VtkMesh makeElementMesh(const contact::ContactPairDefinition& definition,
                        const std::vector<std::vector<ElementField>>& fields, Precision precision,
                        const contact::Pose& X_FM) {
  VtkMesh mesh;
  const contact::Pose X_FG = definition.gridOn == contact::GridOn::moving ? X_FM : contact::Pose{};
  for (size_t c = 0; c < fields.size(); ++c) appendCompartment(definition.compartments.at(c), fields[c], X_FG, mesh);
  if (precision == Precision::full) {
    addCellData<double>(fields, true, mesh);
  } else {
    addCellData<float>(fields, false, mesh);
  }
  return mesh;
}

void writeElementCsv(const fs::path& file, const contact::ContactPairDefinition& definition,
                     const std::vector<std::vector<ElementField>>& fields) {
  fs::path temporary = file;
  temporary += ".part";
  std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
  out << "compartment,ix,iz,x_m,y_m,z_m,normal_x,normal_y,normal_z,area_m2,distance_m,penetration_m,thickness_m,"
         "pressure_Pa,direction_x,direction_y,direction_z,contact,contact_share,force_N,level,unresolved\n";
  fmt::memory_buffer buffer;
  const auto flush = [&] {
    out.write(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    buffer.clear();
  };
  for (size_t c = 0; c < fields.size(); ++c) {
    for (const auto& e : fields[c]) {
      fmt::format_to(std::back_inserter(buffer), "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n",
                     definition.compartments.at(c).name, e.ix, e.iz, e.p_FA.x(), e.p_FA.y(), e.p_FA.z(), e.normal_F.x(),
                     e.normal_F.y(), e.normal_F.z(), e.area_m2, e.distance_m, e.d_m, e.h_m, e.p_Pa,
                     e.forceDirection_F.x(), e.forceDirection_F.y(), e.forceDirection_F.z(), e.active ? 1 : 0,
                     e.contactShare, e.force_N, e.level, e.unresolved ? 1 : 0);
      if (buffer.size() > 60000) flush();
    }
  }
  flush();
  out.close();
  if (!out) {
    const std::string reason = std::strerror(errno);
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw InputError("\"" + file.string() + "\": cannot be written: " + reason);
  }
  fs::rename(temporary, file);
}

VtkMesh tessellate(const std::vector<const contact::ContactSurface*>& surfaces, const contact::Pose& X_AB,
                   int minSamples) {
  VtkMesh mesh;
  mesh.cornersPerCell = 3;
  std::vector<float> normals;
  const auto sample = [minSamples](const std::vector<double>& breaks) {
    const int spans = static_cast<int>(breaks.size()) - 1;
    const int splits = std::max(1, (minSamples + spans - 1) / spans);
    std::vector<double> values;
    for (size_t i = 0; i + 1 < breaks.size(); ++i) {
      for (int s = 0; s < splits; ++s) values.push_back(breaks[i] + (breaks[i + 1] - breaks[i]) * s / splits);
    }
    values.push_back(breaks.back());
    return values;
  };
  for (const auto* surface : surfaces) {
    for (int p = 0; p < surface->numPatches(); ++p) {
      const auto& patch = surface->patch(p);
      const std::vector<double> us = sample(patch.breaksU()), vs = sample(patch.breaksV());
      const auto base = static_cast<std::int32_t>(mesh.numPoints());
      for (double u : us) {
        for (double v : vs) {
          const Vec3 point = X_AB.apply(patch.calcPoint(u, v));
          const Vec3 normal = X_AB.R * patch.calcNormal(u, v);
          mesh.points.insert(mesh.points.end(), {point.x(), point.y(), point.z()});
          for (int axis = 0; axis < 3; ++axis) normals.push_back(static_cast<float>(normal[axis]));
        }
      }
      const auto numV = static_cast<std::int32_t>(vs.size());
      const bool turned = patch.normalSign() < 0;
      for (std::int32_t i = 0; i + 1 < static_cast<std::int32_t>(us.size()); ++i) {
        for (std::int32_t j = 0; j + 1 < numV; ++j) {
          const std::int32_t a = base + i * numV + j, b = a + numV;
          if (turned) {
            mesh.connectivity.insert(mesh.connectivity.end(), {a, a + 1, b + 1, a, b + 1, b});
          } else {
            mesh.connectivity.insert(mesh.connectivity.end(), {a, b, b + 1, a, b + 1, a + 1});
          }
        }
      }
    }
  }
  mesh.pointData.push_back({"Normals", 3, std::move(normals)});
  return mesh;
}

}  // namespace genu::report
