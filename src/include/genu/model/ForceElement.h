#pragma once

#include <Simbody.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "genu/scene/Elements.h"
#include "genu/scene/Trajectory.h"

namespace genu::model {

class KneeSystem;

/** A force element of a scene inside a KneeSystem: it adds its Simbody forces when it is made, and reports what they do.
 docs/extending.md builds one step by step. SI units. */
class ForceElement {
 public:
  explicit ForceElement(std::shared_ptr<const scene::ElementDefinition> definition) : definition_(std::move(definition)) {}
  virtual ~ForceElement() = default;
  ForceElement(const ForceElement&) = delete;
  ForceElement& operator=(const ForceElement&) = delete;

  const scene::ElementDefinition& definition() const { return *definition_; }

  /** What calcOutputs() gives, in order; quantity and SI unit, the rest is filled in. */
  virtual std::vector<scene::ElementColumn> outputs() const { return {}; }
  /** Stage::Dynamics. */
  virtual void calcOutputs(const SimTK::State&, double* /*values*/) const {}

  /** States of the element among the State's Z: their indices, and the error of each that an `accuracy` of 1 allows (1000 times what is
   tolerable, as with 1 mm for lengths at the default 1e-4). Stage::Topology. */
  struct OwnState {
    int index = 0;
    double unit = 1;
  };
  virtual std::vector<OwnState> states(const SimTK::State&) const { return {}; }
  /** Sets its states to their equilibrium at the State's time and pose, all at rest. The State is realized to Stage::Position. */
  virtual void settle(SimTK::State&) const {}

  /** A problem that makes the State's forces meaningless, with advice; empty: none. Stage::Position. */
  virtual std::string findProblem(const SimTK::State&) const { return {}; }

  /** Line along which it acts, in ground, for pictures; may be empty. Stage::Position. */
  virtual std::vector<contact::Vec3> calcPath(const SimTK::State&) const { return {}; }

 private:
  std::shared_ptr<const scene::ElementDefinition> definition_;
};

/** Makes an element from its definition and adds its forces to the system. @throws InputError, its place begun with scene.where(key()) */
using ForceElementMaker = std::function<std::unique_ptr<ForceElement>(std::shared_ptr<const scene::ElementDefinition>, KneeSystem&)>;

/** Adds a section `keyword` to scene files: `reader` turns the value of `keyword.NAME` into a definition, `maker` that into an element.
 Once per keyword, before a scene is read. Returns true, so that a namespace-scope constant can call it.
 @throws std::invalid_argument when the keyword is taken */
bool registerForceElement(const std::string& keyword, scene::ElementReader reader, ForceElementMaker maker);

}  // namespace genu::model
