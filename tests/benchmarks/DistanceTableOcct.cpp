// Open CASCADE's closest points and line intersections in the distance table. It works in mm.

#include <BRepBuilderAPI_MakeFace.hxx>
#include <BRepBuilderAPI_MakeVertex.hxx>
#include <BRepExtrema_DistShapeShape.hxx>
#include <Extrema_ExtPS.hxx>
#include <Extrema_GenLocateExtPS.hxx>
#include <GeomAPI_IntCS.hxx>
#include <GeomAPI_ProjectPointOnSurf.hxx>
#include <GeomAdaptor_Surface.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Geom_Line.hxx>
#include <TopoDS_Builder.hxx>
#include <TopoDS_Compound.hxx>
#include <cmath>
#include <limits>

#include "DistanceTable.h"

namespace distance_table {

namespace {

constexpr double kMm = 1e3;

Handle(Geom_BSplineSurface) makeSurface(const Patch& p) {
  TColgp_Array2OfPnt poles(1, p.numU, 1, p.numV);
  TColStd_Array2OfReal weights(1, p.numU, 1, p.numV);
  for (int i = 0; i < p.numU; ++i) {
    for (int j = 0; j < p.numV; ++j) {
      const auto at = static_cast<size_t>(i * p.numV + j);
      poles.SetValue(i + 1, j + 1, gp_Pnt(kMm * p.points[3 * at], kMm * p.points[3 * at + 1], kMm * p.points[3 * at + 2]));
      weights.SetValue(i + 1, j + 1, p.weights.empty() ? 1.0 : p.weights[at]);
    }
  }
  const auto split = [](const std::vector<double>& knots, std::vector<double>& values, std::vector<int>& counts) {
    for (const double k : knots) {
      if (values.empty() || values.back() != k) {
        values.push_back(k);
        counts.push_back(0);
      }
      ++counts.back();
    }
  };
  std::vector<double> ku, kv;
  std::vector<int> mu, mv;
  split(p.knotsU, ku, mu);
  split(p.knotsV, kv, mv);
  TColStd_Array1OfReal knotsU(1, static_cast<int>(ku.size())), knotsV(1, static_cast<int>(kv.size()));
  TColStd_Array1OfInteger countsU(1, static_cast<int>(ku.size())), countsV(1, static_cast<int>(kv.size()));
  for (size_t i = 0; i < ku.size(); ++i) {
    knotsU.SetValue(static_cast<int>(i) + 1, ku[i]);
    countsU.SetValue(static_cast<int>(i) + 1, mu[i]);
  }
  for (size_t i = 0; i < kv.size(); ++i) {
    knotsV.SetValue(static_cast<int>(i) + 1, kv[i]);
    countsV.SetValue(static_cast<int>(i) + 1, mv[i]);
  }
  if (p.weights.empty()) return new Geom_BSplineSurface(poles, knotsU, knotsV, countsU, countsV, p.degreeU, p.degreeV);
  return new Geom_BSplineSurface(poles, weights, knotsU, knotsV, countsU, countsV, p.degreeU, p.degreeV);
}

gp_Pnt point(const Query& q) { return gp_Pnt(kMm * q.Q[0], kMm * q.Q[1], kMm * q.Q[2]); }

/** Times find(query) -> distance [m] (NaN: failed) over the first `count` queries; those that were checked give the error. */
template <class Find>
Row makeRow(const char* name, const std::vector<Query>& queries, size_t count, int repeats, bool ray, const Find& find) {
  Row row;
  row.method = name;
  count = std::min(count, queries.size());
  double sum = 0;
  measure(repeats, static_cast<int>(count), row, [&] {
    for (size_t i = 0; i < count; ++i) sum += find(queries[i]);
  });
  for (size_t i = 0; i < count; ++i) {
    const double d = find(queries[i]);
    row.failed += std::isnan(d);
    if (queries[i].checked && !std::isnan(d))
      row.error_m = std::max(row.error_m, std::abs(d - (ray ? queries[i].t : queries[i].distance)));
  }
  return row;
}

}  // namespace

std::vector<Row> measureOcct(const std::vector<Patch>& patches, const std::vector<Query>& queries, bool quick) {
  const double nan = std::nan("");
  const int repeats = quick ? 1 : 5;
  const size_t few = quick ? 5 : 40;
  std::vector<Handle(Geom_BSplineSurface)> surfaces;
  for (const Patch& p : patches) surfaces.push_back(makeSurface(p));
  std::vector<Row> rows;
  const double uTol = 1e-10, vTol = 1e-10;

  if (surfaces.size() == 1) {
    const Handle(Geom_BSplineSurface)& surface = surfaces[0];
    const GeomAdaptor_Surface adaptor(surface);
    Extrema_GenLocateExtPS locate(adaptor, uTol, vTol);
    rows.push_back(makeRow("OCCT GenLocateExtPS, warm", queries, quick ? 50 : 400, repeats, false, [&](const Query& q) {
      locate.Perform(point(q), q.u, q.v);
      return locate.IsDone() ? std::sqrt(locate.SquareDistance()) / kMm : nan;
    }));
    Extrema_ExtPS extrema;
    extrema.SetFlag(Extrema_ExtFlag_MIN);
    double u0, u1, v0, v1;
    surface->Bounds(u0, u1, v0, v1);
    extrema.Initialize(adaptor, u0, u1, v0, v1, uTol, vTol);
    rows.push_back(makeRow("OCCT Extrema_ExtPS, minimum, cold", queries, few, repeats, false, [&](const Query& q) {
      extrema.Perform(point(q));
      if (!extrema.IsDone()) return nan;
      double best = std::numeric_limits<double>::infinity();
      for (int k = 1; k <= extrema.NbExt(); ++k) best = std::min(best, extrema.SquareDistance(k));
      return std::isfinite(best) ? std::sqrt(best) / kMm : nan;
    }));
    for (const bool tree : {true, false}) {
      GeomAPI_ProjectPointOnSurf project;
      project.Init(surface, u0, u1, v0, v1, 1e-10, tree ? Extrema_ExtAlgo_Tree : Extrema_ExtAlgo_Grad);
      rows.push_back(makeRow(tree ? "OCCT ProjectPointOnSurf, tree, cold" : "OCCT ProjectPointOnSurf, default, cold", queries,
                             few, repeats, false, [&](const Query& q) {
                               project.Perform(point(q));
                               return project.IsDone() && project.NbPoints() > 0 ? project.LowerDistance() / kMm : nan;
                             }));
    }
  } else {
    TopoDS_Builder builder;  // BRep_Builder.hxx needs a header that Debian 12 leaves out
    TopoDS_Compound faces;
    builder.MakeCompound(faces);
    for (const auto& surface : surfaces) builder.Add(faces, BRepBuilderAPI_MakeFace(surface, 1e-7).Face());
    rows.push_back(makeRow("OCCT BRepExtrema point-faces, cold", queries, few / 2, 1, false, [&](const Query& q) {
      BRepExtrema_DistShapeShape shapes(BRepBuilderAPI_MakeVertex(point(q)).Vertex(), faces);
      return shapes.IsDone() ? shapes.Value() / kMm : nan;
    }));
  }

  rows.push_back(makeRow(surfaces.size() == 1 ? "OCCT GeomAPI_IntCS ray, cold" : "OCCT GeomAPI_IntCS ray, every patch, cold",
                         queries, few / 4 + 1, 1, true, [&](const Query& q) {
                           const Handle(Geom_Line) line = new Geom_Line(point(q), gp_Dir(q.n[0], q.n[1], q.n[2]));
                           double best = nan;
                           for (const auto& surface : surfaces) {
                             GeomAPI_IntCS cut(line, surface);
                             if (!cut.IsDone()) continue;
                             for (int k = 1; k <= cut.NbPoints(); ++k) {
                               double u, v, t;
                               cut.Parameters(k, u, v, t);
                               if (std::isnan(best) || std::abs(t) < std::abs(best))
                                 best = t;  // near the surface the nearest crossing is the first
                             }
                           }
                           return best / kMm;
                         }));
  return rows;
}

}  // namespace distance_table
