#include "genu/contact/AnalyticSurface.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace genu::contact {

namespace {

[[noreturn]] void failParameter(const char* shape, const char* name, double value, const char* allowed) {
  std::ostringstream out;
  out.precision(10);
  out << shape << ": " << name << " = " << value << " is not allowed; allowed: " << allowed;
  throw std::invalid_argument(out.str());
}

void requirePositive(const char* shape, const char* name, double value, bool infiniteAllowed) {
  if (!(value > 0) || (!infiniteAllowed && std::isinf(value))) {
    failParameter(shape, name, value, infiniteAllowed ? "> 0, or inf" : "finite and > 0");
  }
}

void requireFinite(const char* shape, const char* name, double value) {
  if (!std::isfinite(value)) failParameter(shape, name, value, "a finite number");
}

/** A planar rational curve: homogeneous control values (w a, w b, w) and knots; a and b are the two coordinates. */
struct Curve {
  int degree = 1;
  std::vector<double> knots;
  struct Point {
    double a, b, w;
  };
  std::vector<Point> points;
};

/** Unit circle arc (cos, sin) over [from, to], rational quadratic pieces of at most 60 degrees (Piegl & Tiller §7.3). */
Curve makeArc(double from, double to) {
  const int pieces = std::max(1, static_cast<int>(std::ceil((to - from) / (kPi / 3) - 1e-9)));
  const double half = 0.5 * (to - from) / pieces;
  Curve c;
  c.degree = 2;
  c.knots.assign(3, from);
  for (int i = 0; i < pieces; ++i) {
    const double t0 = from + 2 * half * i, tm = t0 + half, t1 = t0 + 2 * half;
    if (i == 0) c.points.push_back({std::cos(t0), std::sin(t0), 1});
    const double w = std::cos(half);
    c.points.push_back({std::cos(tm) / w, std::sin(tm) / w, w});
    const double end = i + 1 == pieces ? to : t1;
    c.points.push_back({std::cos(end), std::sin(end), 1});
    c.knots.insert(c.knots.end(), i + 1 == pieces ? 3 : 2, end);
  }
  return c;
}

/** Full circle, closed exactly: the last point equals the first to the last bit. */
Curve makeCircle() {
  Curve c = makeArc(0, 2 * kPi);
  c.points.back() = c.points.front();
  return c;
}

/** Straight parameter line t in [-half, half] as `a`; b = 1. */
Curve makeLine(double half) {
  Curve c;
  c.degree = 1;
  c.knots = {-half, -half, half, half};
  c.points = {{-half, 1, 1}, {half, 1, 1}};
  return c;
}

/** Tensor product of two curves: point(i, j) -> position. Weights multiply. */
template <class Position>
NurbsPatch makeProduct(const Curve& u, const Curve& v, Position position) {
  NurbsPatchData d;
  d.degreeU = u.degree;
  d.degreeV = v.degree;
  d.knotsU = u.knots;
  d.knotsV = v.knots;
  d.numU = static_cast<int>(u.points.size());
  d.numV = static_cast<int>(v.points.size());
  bool rational = false;
  for (const auto& pu : u.points) {
    for (const auto& pv : v.points) {
      d.points.push_back(position(pu, pv));
      d.weights.push_back(pu.w * pv.w);
      rational = rational || d.weights.back() != 1;
    }
  }
  if (!rational) d.weights.clear();
  return NurbsPatch(std::move(d));
}

/** Turns the normal of a height field to the side without material. */
std::vector<NurbsPatch> orientHeightField(NurbsPatch patch, Solid solid) {
  const double u = 0.5 * (patch.uMin() + patch.uMax()), v = 0.5 * (patch.vMin() + patch.vMax());
  const bool wantUp = solid != Solid::above;
  const bool isUp = patch.calcNormal(u, v).y() > 0;
  std::vector<NurbsPatch> patches;
  patches.push_back(wantUp == isUp ? std::move(patch) : patch.flipped());
  return patches;
}

}  // namespace

std::vector<NurbsPatch> makePlane(double y0, double sx, double sz, Solid solid, double halfExtent) {
  requireFinite("plane", "y0", y0);
  requireFinite("plane", "sx", sx);
  requireFinite("plane", "sz", sz);
  requirePositive("plane", "extent", halfExtent, false);
  const Curve line = makeLine(halfExtent);
  return orientHeightField(makeProduct(line, line,
                                       [&](const Curve::Point& z, const Curve::Point& x) {
                                         return Vec3(x.a, y0 + sx * x.a + sz * z.a, z.a);
                                       }),
                           solid);
}

std::vector<NurbsPatch> makeParaboloid(double y0, double Rx, double Rz, Solid solid, double halfExtent) {
  requireFinite("paraboloid", "y0", y0);
  if (Rx == 0 || std::isnan(Rx)) failParameter("paraboloid", "Rx", Rx, "not 0; negative or inf are fine");
  if (Rz == 0 || std::isnan(Rz)) failParameter("paraboloid", "Rz", Rz, "not 0; negative or inf are fine");
  requirePositive("paraboloid", "extent", halfExtent, false);
  // Quadratic Bezier of t over [-L, L]: t -> (-L, 0, L), t^2 -> (L^2, -L^2, L^2), here with b = t^2.
  const double L = halfExtent;
  Curve q;
  q.degree = 2;
  q.knots = {-L, -L, -L, L, L, L};
  q.points = {{-L, L * L, 1}, {0, -L * L, 1}, {L, L * L, 1}};
  return orientHeightField(makeProduct(q, q,
                                       [&](const Curve::Point& z, const Curve::Point& x) {
                                         return Vec3(x.a, y0 + x.b / (2 * Rx) + z.b / (2 * Rz), z.a);
                                       }),
                           solid);
}

std::vector<NurbsPatch> makeDish(double y0, double Rs, double Rf, Solid solid, double halfExtent) {
  requireFinite("dish", "y0", y0);
  requirePositive("dish", "Rs", Rs, true);
  requirePositive("dish", "Rf", Rf, true);
  requirePositive("dish", "extent", halfExtent, false);
  if (std::isinf(Rs) && std::isinf(Rf)) return makePlane(y0, 0, 0, solid, halfExtent);

  // Half angle of an arc of radius R that reaches the extent; a right angle is where the height field ends.
  const auto halfAngle = [&](double R) { return halfExtent < R ? std::asin(halfExtent / R) : 0.5 * kPi; };
  if (std::isinf(Rf)) {
    const double a = halfAngle(Rs);
    return orientHeightField(makeProduct(makeLine(halfExtent), makeArc(-a, a),
                                         [&](const Curve::Point& z, const Curve::Point& x) {
                                           return Vec3(Rs * x.b, y0 + Rs - Rs * x.a, z.a);
                                         }),
                             solid);
  }
  // The section in planes through z ends where it meets the axis of rotation (Rf > Rs) or at a right angle.
  double a = halfAngle(Rf);
  if (std::isfinite(Rs) && Rf > Rs) a = std::min(a, std::acos((Rf - Rs) / Rf));
  const Curve section = makeArc(-a, a);
  if (std::isinf(Rs)) {
    return orientHeightField(makeProduct(section, makeLine(halfExtent),
                                         [&](const Curve::Point& z, const Curve::Point& x) {
                                           return Vec3(x.a, y0 + Rf - Rf * z.a, Rf * z.b);
                                         }),
                             solid);
  }
  const double b = halfAngle(Rs);
  return orientHeightField(makeProduct(section, makeArc(-b, b),
                                       [&](const Curve::Point& z, const Curve::Point& x) {
                                         const double rho = Rs - Rf + Rf * z.a;
                                         return Vec3(rho * x.b, y0 + Rs - rho * x.a, Rf * z.b);
                                       }),
                           solid);
}

std::vector<NurbsPatch> makeEllipsoid(double a, double b, double c) {
  requirePositive("ellipsoid", "a", a, false);
  requirePositive("ellipsoid", "b", b, false);
  requirePositive("ellipsoid", "c", c, false);
  // Stereographic chart of the unit sphere from one end of the y axis:
  //   x = 2u/D, y = (1 - u^2 - v^2)/D, z = 2v/D, D = 1 + u^2 + v^2, rational biquadratic. The chart from the other end has
  //   y turned. |u|, |v| <= 1.2 reaches past the equator everywhere (the disc u^2 + v^2 <= 1 is a half sphere), so that the
  //   foot of any query lies well inside one of the two. Split at 0, where all weights stay positive.
  const double U = 1.2;
  const double t[5] = {-U, -U / 2, 0, U / 2, U};    // control values of t
  const double t2[5] = {U * U, 0, 0, 0, U * U};     // control values of t^2
  std::vector<NurbsPatch> patches;
  for (const double side : {1.0, -1.0}) {
    NurbsPatchData d;
    d.degreeU = d.degreeV = 2;
    d.numU = d.numV = 5;
    d.knotsU = {-U, -U, -U, 0, 0, U, U, U};
    d.knotsV = d.knotsU;
    for (int i = 0; i < 5; ++i) {
      for (int j = 0; j < 5; ++j) {
        const double w = 1 + t2[i] + t2[j];
        const double y = 1 - t2[i] - t2[j];
        d.points.push_back(Vec3(a * 2 * t[i] / w, side * b * y / w, c * 2 * t[j] / w));
        d.weights.push_back(w);
      }
    }
    d.flipNormal = side > 0;  // x cross z points down
    patches.emplace_back(std::move(d));
  }
  return patches;
}

std::vector<NurbsPatch> makeSphere(double R) {
  requirePositive("sphere", "R", R, false);
  return makeEllipsoid(R, R, R);
}

std::vector<NurbsPatch> makeCylinder(double R, double length) {
  requirePositive("cylinder", "R", R, false);
  requirePositive("cylinder", "length", length, false);
  std::vector<NurbsPatch> patches;
  patches.push_back(makeProduct(makeCircle(), makeLine(0.5 * length), [&](const Curve::Point& c, const Curve::Point& z) {
    return Vec3(R * c.a, R * c.b, z.a);
  }));
  return patches;
}

std::vector<NurbsPatch> makeTorus(double Rs, double Rf) {
  requirePositive("torus", "Rs", Rs, false);
  requirePositive("torus", "Rf", Rf, false);
  if (Rf >= Rs) failParameter("torus", "Rf", Rf, "0 < Rf < Rs");
  const double axis = Rs - Rf;  // radius of the circle of section centers
  // A section that reaches the axis (Rf > Rs/2) ends there: only the outside of a spindle torus bounds a solid.
  const bool spindle = Rf >= axis;
  const double end = spindle ? std::acos(-axis / Rf) : kPi;
  const Curve section = spindle ? makeArc(-end, end) : makeCircle();
  std::vector<NurbsPatch> patches;
  patches.push_back(makeProduct(makeCircle(), section, [&](const Curve::Point& c, const Curve::Point& s) {
    // The spindle's ends lie on the axis: exactly, so that they are recognised as poles.
    const double rho = axis + Rf * s.a;
    return Vec3(rho * c.a, rho * c.b, Rf * s.b);
  }));
  return patches;
}

}  // namespace genu::contact
