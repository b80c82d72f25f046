// Any text and any poses through the C interface: a status, never a crash, a hang or an unnoticed NaN.
// Input: a JSON description, a zero byte, then the poses (Source).

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "Source.h"
#include "genu/contact/genu_contact.h"
#include "genu/contact/genu_contact_description.h"

namespace {

using genu::fuzz::require;
using genu::fuzz::Source;
using Json = nlohmann::json;

// A description may ask for 16 million cells, which is allowed and takes minutes. Only the cost is cut here.
// Deep inside a round solid every query is a search of its own, 50 times as slow as near the surface.
constexpr int kMaxCells = 6, kMaxSamples = 9;
constexpr std::size_t kMaxCompartments = 3;

void cap(Json& list, int most) {
  if (!list.is_array()) return;
  for (Json& n : list) {
    if (n.is_number_integer() && n > most) n = most;
  }
}

/** The text itself, or the same description with smaller grids. */
std::string limitCost(const std::string& text) {
  Json j = Json::parse(text, nullptr, false);
  if (!j.is_object()) return text;
  if (j.contains("compartments") && j["compartments"].is_array()) {
    Json& list = j["compartments"];
    if (list.size() > kMaxCompartments) list.erase(list.begin() + kMaxCompartments, list.end());
    for (Json& c : list) {
      if (c.is_object() && c.contains("grid")) cap(c["grid"], kMaxCells);
    }
  }
  for (const char* key : {"fixed_thickness", "moving_thickness"}) {
    if (!j.contains(key) || !j[key].is_object()) continue;
    j[key]["map_samples"] = j[key].value("map_samples", Json::array({kMaxSamples, kMaxSamples}));
    cap(j[key]["map_samples"], kMaxSamples);
  }
  return j.dump(-1, ' ', false, Json::error_handler_t::replace);
}

bool allFinite(const double* values, int count) {
  return std::all_of(values, values + count, [](double value) { return std::isfinite(value); });
}

/** A result that is said to have a meaning has one. */
void requireSound(genu_status status, const genu_load& load) {
  if (status >= GENU_NOT_CONVERGED) return;
  require(allFinite(load.force_on_moving, 3) && allFinite(load.moment_on_moving_about_fixed_origin, 3));
  require(std::isfinite(load.scalar_force) && load.scalar_force >= 0);
  require(std::isfinite(load.peak_pressure) && load.peak_pressure >= 0 && load.area >= 0 && std::isfinite(load.energy));
  require(load.active_elements >= 0 && load.boundary_elements >= 0 && load.not_converged_queries == 0);
}

void evaluate(const genu_pair* pair, genu_workspace* workspace, Source& source) {
  double q[6], rates[6];
  const int kind = source.choose(8);
  for (double& value : q) value = kind == 0 ? source.any() : kind == 1 ? 1e6 * source.next() : 0.1 * source.next();
  if (kind == 2) q[1] = 1.5707963267948966;  // gimbal lock
  for (double& value : rates) value = kind == 0 ? source.any() : source.next();
  const bool finite = allFinite(q, 6) && allFinite(rates, 6);
  genu_evaluate_options options;
  genu_evaluate_options_init(&options, sizeof options);
  options.with_energy = source.choose(2);
  options.with_stiffness = source.choose(2);
  genu_result result;
  genu_result_init(&result, sizeof result);
  std::vector<genu_load> loads(static_cast<std::size_t>(genu_pair_num_compartments(pair)));
  const int count = static_cast<int>(loads.size());
  genu_status status = genu_evaluate(pair, workspace, q, rates, &options, &result, loads.data(), count);
  if (status == GENU_BAD_ARGUMENT && finite && options.with_stiffness) {  // the centre rule has none
    options.with_stiffness = 0;
    status = genu_evaluate(pair, workspace, q, rates, &options, &result, loads.data(), count);
  }
  require(finite ? status <= GENU_NOT_CONVERGED : status == GENU_BAD_ARGUMENT);
  if (!finite) return;
  requireSound(status, result.total);
  for (const genu_load& load : loads) requireSound(status, load);
  if (status < GENU_NOT_CONVERGED) require(allFinite(result.stiffness, 36) && std::isfinite(result.power));

  for (int k = 0; k < count; ++k) {
    std::size_t needed = 0;
    require(genu_pair_fields(pair, workspace, k, nullptr, 0, &needed) == GENU_OK);
    std::vector<genu_element> elements(needed);
    require(genu_pair_fields(pair, workspace, k, elements.data(), needed, &needed) == GENU_OK && needed == elements.size());
    for (const genu_element& e : elements) require(e.area >= 0 && e.contact_share >= 0);
  }
  if (source.choose(4) == 0) {
    genu_error_estimate error;
    genu_error_estimate_init(&error, sizeof error);
    status = genu_estimate_error(pair, workspace, static_cast<genu_companion>(source.choose(2)), &error, nullptr, 0);
    require(status <= GENU_BAD_ARGUMENT);  // a coarse companion may have no element
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::uint8_t* end = std::find(data, data + size, std::uint8_t{0});
  const std::string text = limitCost(std::string(data, end));
  Source source{end == data + size ? end : end + 1, static_cast<std::size_t>(end == data + size ? 0 : data + size - end - 1)};
  genu_pair* pair = nullptr;
  const genu_status status = genu_pair_create_from_json(text.c_str(), &pair);
  if (status != GENU_OK) {
    require(status == GENU_BAD_ARGUMENT || status == GENU_OUT_OF_MEMORY);
    require(pair == nullptr && genu_last_error()[0] != '\0');
    return 0;
  }
  genu_workspace* workspace = nullptr;
  require(genu_workspace_create(pair, &workspace) == GENU_OK);
  for (int i = 0; i < 3; ++i) evaluate(pair, workspace, source);
  genu_workspace_destroy(workspace);
  genu_pair_destroy(pair);
  return 0;
}
