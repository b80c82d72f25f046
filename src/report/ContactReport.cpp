#include "genu/report/ContactReport.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

namespace genu::report {
using contact::ContactErrorEstimate;
using contact::ContactResult;
using contact::EvaluationStatus;
using contact::LoadError;
using contact::NetLoad;
using contact::Vec3;
using nlohmann::ordered_json;

namespace {

ordered_json toJson(const Vec3& v) { return ordered_json::array({v.x() + 0.0, v.y() + 0.0, v.z() + 0.0}); }

std::string joinNames(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, ", ")); }

}  // namespace

std::vector<std::string> listCompartmentNames(const scene::Scene& scene) {
  std::vector<std::string> names;
  for (const auto& pair : scene.contacts) {
    for (const auto& compartment : pair.definition.compartments) {
      names.push_back(scene.contacts.size() > 1 ? pair.name + "." + compartment.name : compartment.name);
    }
  }
  return names;
}

std::vector<NamedLoad> listLoads(const scene::Scene& scene, const std::vector<ContactResult>& results) {
  const std::vector<std::string> names = listCompartmentNames(scene);
  std::vector<NamedLoad> loads;
  for (const auto& result : results) {
    for (const auto& load : result.compartments) loads.push_back({names.at(loads.size()), load});
  }
  return loads;
}

NetLoad sumLoads(const std::vector<ContactResult>& results) {
  if (results.size() == 1) return results.front().total;
  NetLoad sum;
  for (const auto& result : results) {
    const NetLoad& load = result.total;
    sum.forceOnM_F += load.forceOnM_F;
    sum.momentOnM_Fo_F += load.momentOnM_Fo_F;
    sum.scalarForce_N += load.scalarForce_N;
    if (load.peakPressure_Pa > sum.peakPressure_Pa) {
      sum.peakPressure_Pa = load.peakPressure_Pa;
      sum.peakPoint_F = load.peakPoint_F;
    }
    sum.area_m2 += load.area_m2;
    sum.centerOfPressure_F += load.scalarForce_N * load.centerOfPressure_F;
    sum.energy_J += load.energy_J;
    sum.maxStrain = std::max(sum.maxStrain, load.maxStrain);
    sum.activeElements += load.activeElements;
    sum.extrapolatedElements += load.extrapolatedElements;
    sum.fullPenetrationElements += load.fullPenetrationElements;
    sum.notConvergedQueries += load.notConvergedQueries;
    sum.unresolvedCompartments += load.unresolvedCompartments;
    sum.boundaryElements += load.boundaryElements;
    sum.noThicknessElements += load.noThicknessElements;
  }
  if (sum.area_m2 > 0) sum.meanPressure_Pa = sum.scalarForce_N / sum.area_m2;
  if (sum.scalarForce_N > 0) sum.centerOfPressure_F /= sum.scalarForce_N;
  return sum;
}

bool sharesFixedBody(const scene::Scene& scene) {
  return std::all_of(scene.contacts.begin(), scene.contacts.end(), [&](const scene::ContactSpec& pair) {
    return pair.fixedBody == scene.contacts.front().fixedBody;
  });
}

EvaluationStatus worstStatus(const std::vector<ContactResult>& results) {
  EvaluationStatus worst = EvaluationStatus::ok;
  for (const auto& result : results) worst = std::max(worst, result.status);
  return worst;
}

bool hasNumbers(EvaluationStatus status) {
  return status == EvaluationStatus::ok || status == EvaluationStatus::extrapolated;
}

double calcUnresolvedShare(const std::vector<contact::ElementField>& fields) {
  double all = 0, unresolved = 0;
  for (const contact::ElementField& e : fields) {
    all += e.force_N;
    if (e.unresolved) unresolved += e.force_N;
  }
  return all > 0 ? unresolved / all : 0;
}

std::string describeUnresolved(const std::string& compartment, double share) {
  // A tenth goes with errors of the elements' forces of some 5 % (docs/theory.md, "Elements beside an edge").
  if (!(share > 0.1)) return "";
  return fmt::format("{}: up to {:.0f} % of the force is on elements beside an edge or fold that the grid does not resolve; their pressures, forces and "
                     "areas are wrong, and the net force may be. Take a finer grid, or estimate the errors",
                     compartment, 100 * share);
}

std::string describeLeftOut(const NetLoad& load) {
  std::string text;
  if (load.boundaryElements > 0) {
    text += fmt::format("; {} elements lie behind the open border of the moving surface and carry nothing",
                        load.boundaryElements);
  }
  if (load.noThicknessElements > 0) {
    text += fmt::format("; {} elements are left out because the moving body's back surface is missed there",
                        load.noThicknessElements);
  }
  return text;
}

std::string describeStatus(const scene::Scene& scene, const std::vector<ContactResult>& results) {
  const EvaluationStatus status = worstStatus(results);
  std::vector<std::string> where;
  int count = 0, unresolved = 0;
  for (const auto& [name, load] : listLoads(scene, results)) {
    const int elements = status == EvaluationStatus::extrapolated      ? load.extrapolatedElements
                         : status == EvaluationStatus::fullPenetration ? load.fullPenetrationElements
                         : status == EvaluationStatus::notConverged    ? load.notConvergedQueries + load.unresolvedCompartments
                                                                       : 0;
    if (elements > 0) where.push_back(name);
    count += elements;
    unresolved += load.unresolvedCompartments;
  }
  const std::string place = where.empty() ? "" : fmt::format(" in {}", joinNames(where));
  switch (status) {
    case EvaluationStatus::ok: {
      const NetLoad sum = sumLoads(results);
      return (sum.activeElements > 0 ? fmt::format("contact, {} active elements", sum.activeElements) : "no contact") +
             describeLeftOut(sum);
    }
    case EvaluationStatus::extrapolated:
      return fmt::format(
                 "{} elements{} are pressed beyond 95 % of the layer thickness; their pressure follows the tangent of "
                 "the law "
                 "there and is only indicative",
                 count, place) +
             describeLeftOut(sumLoads(results));
    case EvaluationStatus::fullPenetration:
      return fmt::format(
          "full penetration: {} elements{} are pressed to their whole thickness or meet a surface that faces away, so "
          "pressure has no meaning; check the pose, the units of the surfaces, the direction of their normals and the "
          "layer thickness",
          count, place);
    case EvaluationStatus::notConverged:
      if (count > unresolved) break;
      if (unresolved > 0) {
        return fmt::format(
            "not converged: the pressures{} sum up to less than nothing, because the grid is too coarse for walls or folds of the "
            "surfaces in contact, so there is no result; use more divisions or rule: centre",
            place);
      }
      return "not converged: the load is beyond the range of numbers, so there is no result; check the units of lengths and moduli";
  }
  return fmt::format(
      "not converged: {} closest-point queries{} failed, so there is no result; check the surfaces for folds, repeated control points "
      "and extreme weights",
      count - unresolved, place);
}

ordered_json toJson(const NetLoad& load, bool withVectors) {
  ordered_json json;
  if (withVectors) {
    json["force_on_moving_N"] = toJson(load.forceOnM_F);
    json["moment_on_moving_about_fixed_origin_Nm"] = toJson(load.momentOnM_Fo_F);
    json["force_on_fixed_N"] = toJson(load.forceOnF_F());
  }
  json["scalar_force_N"] = load.scalarForce_N;
  json["peak_pressure_Pa"] = load.peakPressure_Pa;
  json["mean_pressure_Pa"] = load.meanPressure_Pa;
  json["area_m2"] = load.area_m2;
  json["active_elements"] = load.activeElements;
  if (withVectors) {
    json["center_of_pressure_m"] = toJson(load.centerOfPressure_F);
    json["peak_point_m"] = toJson(load.peakPoint_F);
  }
  json["energy_J"] = load.energy_J;
  json["max_strain"] = load.maxStrain;
  json["extrapolated_elements"] = load.extrapolatedElements;
  json["boundary_elements"] = load.boundaryElements;
  json["no_thickness_elements"] = load.noThicknessElements;
  return json;
}

std::vector<LoadError> listErrors(const std::vector<ContactErrorEstimate>& errors) {
  std::vector<LoadError> list;
  for (const auto& pair : errors) list.insert(list.end(), pair.compartments.begin(), pair.compartments.end());
  return list;
}

LoadError sumErrors(const std::vector<ContactResult>& results, const std::vector<ContactErrorEstimate>& errors) {
  if (errors.size() == 1) return errors.front().total;
  LoadError sum;
  double highest = 0;
  for (size_t k = 0; k < errors.size(); ++k) {
    const LoadError& e = errors[k].total;
    sum.force_N += e.force_N;
    sum.moment_Nm += e.moment_Nm;
    sum.area_m2 += e.area_m2;
    // mean = sum of (mean of a pair times its area) / area
    sum.meanPressure_Pa += e.meanPressure_Pa * results.at(k).total.area_m2;
    if (results[k].total.peakPressure_Pa >= highest) {
      highest = results[k].total.peakPressure_Pa;
      sum.peakPressure_Pa = e.peakPressure_Pa;
    }
  }
  const double area = sumLoads(results).area_m2;
  sum.meanPressure_Pa = area > 0 ? sum.meanPressure_Pa / area : 0;
  return sum;
}

ordered_json toJson(const LoadError& error) {
  return {{"force_N", error.force_N},
          {"moment_Nm", error.moment_Nm},
          {"peak_pressure_Pa", error.peakPressure_Pa},
          {"mean_pressure_Pa", error.meanPressure_Pa},
          {"area_m2", error.area_m2}};
}

ordered_json toJson(const scene::Scene& scene, const std::vector<ContactResult>& results,
                    const std::vector<ContactErrorEstimate>& errors) {
  const EvaluationStatus status = worstStatus(results);
  ordered_json json;
  json["status"] = contact::toString(status);
  json["status_text"] = describeStatus(scene, results);
  if (!hasNumbers(status)) return json;
  json["compartments"] = ordered_json::object();
  const std::vector<LoadError> list = listErrors(errors);
  size_t row = 0;
  for (const auto& [name, load] : listLoads(scene, results)) {
    json["compartments"][name] = toJson(load);
    if (!list.empty()) json["compartments"][name]["error_estimate"] = toJson(list.at(row));
    ++row;
  }
  json["total"] = toJson(sumLoads(results), sharesFixedBody(scene));
  if (!list.empty()) json["total"]["error_estimate"] = toJson(sumErrors(results, errors));
  return json;
}

std::string formatTable(const scene::Scene& scene, const std::vector<ContactResult>& results,
                        const std::vector<ContactErrorEstimate>& errors) {
  std::vector<NamedLoad> rows = listLoads(scene, results);
  const NetLoad total = sumLoads(results);
  const bool withTotal = rows.size() > 1 && sharesFixedBody(scene);
  if (withTotal) rows.push_back({"total", total});
  size_t width = 11;
  for (const auto& row : rows) width = std::max(width, row.name.size());

  std::string text = fmt::format("{:<{}}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}\n", "", width, "force",
                                 "|force|", "|torque|", "peak", "mean", "area", "elements");
  text += fmt::format("{:<{}}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}\n", "compartment", width, "N", "N",
                      "N m", "MPa", "MPa", "mm^2", "");
  for (const auto& [name, load] : rows) {
    text +=
        fmt::format("{:<{}}  {:>9.4g}  {:>9.4g}  {:>9.4g}  {:>9.4g}  {:>9.4g}  {:>9.4g}  {:>8}\n", name, width,
                    load.scalarForce_N, load.forceOnM_F.norm(), load.momentOnM_Fo_F.norm(), load.peakPressure_Pa * 1e-6,
                    load.meanPressure_Pa * 1e-6, load.area_m2 * 1e6, load.activeElements);
  }
  text += "force: sum of pressure times area; |force|, |torque|: of the resultant, torque about the fixed origin\n";
  if (errors.empty()) return text;
  std::vector<LoadError> list = listErrors(errors);
  if (withTotal) list.push_back(sumErrors(results, errors));
  text += "\nestimated errors of the grid (not of the model, nor of the surfaces)\n";
  for (size_t k = 0; k < rows.size(); ++k) {
    const LoadError& e = list.at(k);
    text += fmt::format("{:<{}}  {:>9}  {:>9.2g}  {:>9.2g}  {:>9.2g}  {:>9.2g}  {:>9.2g}\n", rows[k].name, width, "",
                        e.force_N, e.moment_Nm, e.peakPressure_Pa * 1e-6, e.meanPressure_Pa * 1e-6, e.area_m2 * 1e6);
  }
  return text;
}

}  // namespace genu::report
