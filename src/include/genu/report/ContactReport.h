#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "genu/contact/ContactPair.h"
#include "genu/contact/ErrorEstimate.h"
#include "genu/scene/Scene.h"

namespace genu::report {

/** One row of every table: a compartment with the name used in all outputs, `medial`, or `pair.medial` when the scene
 has more than one contact pair. */
struct NamedLoad {
  std::string name;
  contact::NetLoad load;
};

/** Names of all compartments of the scene, in order. */
std::vector<std::string> listCompartmentNames(const scene::Scene& scene);

/** Loads of all compartments with their names, in the order of listCompartmentNames(). */
std::vector<NamedLoad> listLoads(const scene::Scene& scene, const std::vector<contact::ContactResult>& results);

/** Sum over all contact pairs. Forces, moments about the fixed origin, areas, energies and counts add; the peak is the
 largest; mean pressure and center of pressure are weighted again. @pre all pairs share the fixed body
 (sharesFixedBody()): the vectors are in its frame. */
contact::NetLoad sumLoads(const std::vector<contact::ContactResult>& results);
bool sharesFixedBody(const scene::Scene& scene);

/** Worst status of all pairs. */
contact::EvaluationStatus worstStatus(const std::vector<contact::ContactResult>& results);

/** One sentence for a status: what it means, which compartments, what to do about it. */
std::string describeStatus(const scene::Scene& scene, const std::vector<contact::ContactResult>& results);

/** Does the status allow numbers? fullPenetration and notConverged do not. */
bool hasNumbers(contact::EvaluationStatus status);

/** Share of a compartment's force that is on elements which the grid does not resolve (ElementField::unresolved). */
double calcUnresolvedShare(const std::vector<contact::ElementField>& fields);
/** A sentence for it; empty where a share is too small to matter for a pressure map. */
std::string describeUnresolved(const std::string& compartment, double share);

/** Keys: force_on_moving_N, moment_on_moving_about_fixed_origin_Nm, force_on_fixed_N, scalar_force_N,
 peak_pressure_Pa, peak_point_m, mean_pressure_Pa, area_m2, active_elements, extrapolated_elements,
 center_of_pressure_m, energy_J, max_strain. Without contact all are exactly zero. `withVectors` false leaves out what
 needs a common frame. */
nlohmann::ordered_json toJson(const contact::NetLoad& load, bool withVectors = true);

/** Estimated errors (ErrorEstimate.h) of all compartments, in the order of listCompartmentNames(); none when `errors` is
 empty. */
std::vector<contact::LoadError> listErrors(const std::vector<contact::ContactErrorEstimate>& errors);

/** Error of sumLoads(): those of several pairs add; the peak's is that of the pair that has it. */
contact::LoadError sumErrors(const std::vector<contact::ContactResult>& results,
                             const std::vector<contact::ContactErrorEstimate>& errors);

/** Keys: force_N, moment_Nm, peak_pressure_Pa, mean_pressure_Pa, area_m2. */
nlohmann::ordered_json toJson(const contact::LoadError& error);

/** {status, status_text, compartments: {name: ...}, total}; only the first two when there are no numbers. With `errors`
 every load has an error_estimate. */
nlohmann::ordered_json toJson(const scene::Scene& scene, const std::vector<contact::ContactResult>& results,
                              const std::vector<contact::ContactErrorEstimate>& errors = {});

/** Table as the paper's Table 4: force, torque, peak, mean, area per compartment and in total, with units; with `errors` a
 second one of their estimated errors. */
std::string formatTable(const scene::Scene& scene, const std::vector<contact::ContactResult>& results,
                        const std::vector<contact::ContactErrorEstimate>& errors = {});

}  // namespace genu::report
