#pragma once

// From a place on an element surface to a node on the contact surface.

#include <optional>
#include <vector>

#include "genu/contact/ContactPair.h"

namespace genu::contact::detail {

enum class NodeStatus {
  ok,
  missedSurface,  // no crossing at all
  wrongSide,      // crossings, but only of sheets that face the other way
  behindLimit,    // crossings that face the right way, but at or behind the element plane or the limiting radius
  underPlane,     // behind the plane from which the thickness is measured
  missedBack,     // no thickness
};

struct ProjectedNode {
  NodeStatus status = NodeStatus::missedSurface;
  Vec3 point = Vec3::Zero(), normal = Vec3::Zero();
  double area = 0, h = 0;
  bool missedBack = false, clamped = false;  // of a node that is ok
};

/** Projects the nodes of one compartment's grid. */
class NodeProjector {
 public:
  NodeProjector(const CompartmentDefinition& compartment, const Thickness& thickness, const std::optional<double>& planeY_m);

  const ElementRays& rays() const { return rays_; }
  /** Centre (a, b) of a cell. */
  ProjectedNode projectNode(double a, double b);

 private:
  const ContactSurface& surface_;
  const Thickness& thickness_;
  ElementRays rays_;
  std::optional<double> limit_;  // least advance along the ray (facing 1) or largest one (facing -1)
  double from_, to_;             // reach of the rays
  std::vector<LineHit> hits_, backHits_;
};

}  // namespace genu::contact::detail
