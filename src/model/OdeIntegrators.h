#pragma once

#include "genu/model/OdeIntegrator.h"

namespace genu::model {

std::unique_ptr<OdeIntegrator> makeCPodesDriver(OdeProblem& problem, const OdeSettings& settings);
std::unique_ptr<OdeIntegrator> makeGeneralizedAlpha(OdeProblem& problem, const OdeSettings& settings);

}  // namespace genu::model
