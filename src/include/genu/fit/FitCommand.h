#pragma once

#include <CLI/CLI.hpp>

#include "genu/fit/Fit.h"

namespace genu::fit {

/** Adds the options of `genu fit` to a subcommand; they fill `options` while the command line is parsed.
 Values with a wrong unit or form throw InputError from CLI::App::parse. `options` must outlive `app`. */
void addFitOptions(CLI::App& app, FitOptions& options);

/** Runs the fit and prints the report on stdout. */
void runFitCommand(const FitOptions& options, const scene::Progress& progress = {});

}  // namespace genu::fit
