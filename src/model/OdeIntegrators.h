#pragma once

#include <vector>

#include "genu/model/OdeIntegrator.h"

namespace genu::model {

std::unique_ptr<OdeIntegrator> makeCPodesDriver(OdeProblem& problem, const OdeSettings& settings);
std::unique_ptr<OdeIntegrator> makeGeneralizedAlpha(OdeProblem& problem, const OdeSettings& settings);
std::unique_ptr<OdeIntegrator> makeRungeKuttaMerson(OdeProblem& problem, const OdeSettings& settings);
std::unique_ptr<OdeIntegrator> makeSemiExplicitEuler(OdeProblem& problem, const OdeSettings& settings);

/** y at t in the step from t0 to t1, by the cubic of values and rates at both ends. */
void interpolateCubic(double t, double t0, const std::vector<double>& y0, const std::vector<double>& rate0, double t1,
                      const std::vector<double>& y1, const std::vector<double>& rate1, std::vector<double>& y);

}  // namespace genu::model
