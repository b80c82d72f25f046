#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <exception>
#include <functional>
#include <map>
#include <new>

#include "Commands.h"
#include "genu/fit/FitCommand.h"
#include "genu/io/Suggest.h"
#include "genu/program/Program.h"

namespace genu::app {

namespace {

constexpr const char* kExitCodes =
    "Exit codes: 0 done; 1 internal error; 2 wrong input or command line; 3 the computation failed or has no meaning\n"
    "(no convergence, full penetration, contact never made); 130 interrupted, what was computed is written and "
    "marked.\n";

void addCommonOptions(CLI::App& command, CommonOptions& common) {
  command
      .add_option("--data", common.dataFolder, "Folder of `data:` paths; default: environment variable GENU_DATA_DIR")
      ->type_name("DIR");
  command.add_flag("-q,--quiet", common.console.quiet, "Errors only");
  command.add_flag("-v,--verbose", common.console.verbose, "More messages");
  command.add_flag("--progress", common.console.progress, "Progress lines also where stderr is not a terminal");
}

void addThreads(CLI::App& command, int& threads) {
  command.add_option("--threads", threads, "Threads for contact evaluations with enough to do; 0: all of the machine. Results are the same")
      ->type_name("N")
      ->capture_default_str();
}

void addRunOptions(CLI::App& command, RunOptions& options, const std::string& outputDefault,
                   const std::string& gridText) {
  command.add_option("-o,--output", options.output, "Folder for the results; default: " + outputDefault)
      ->type_name("DIR");
  command.add_option("--grid", options.grid, gridText)->type_name("NXxNZ");
  command
      .add_option("--reference", options.reference,
                  "Table with a known motion to draw and compare, columns like rx_deg, z_mm over time or percent_cycle")
      ->type_name("FILE");
  command.add_option("--side", options.side, "Labels of the pressure maps; x is posterior in a right knee")
      ->check(CLI::IsMember({"right", "left"}))
      ->capture_default_str();
  command.add_flag("--no-maps", options.noMaps, "No .vtp pressure maps and surfaces");
  command.add_flag("--no-plots", options.noPlots, "No plots");
  addThreads(command, options.threads);
}

CLI::Option* addScene(CLI::App& command, std::filesystem::path& scene) {
  return command.add_option("SCENE", scene, "Scene file (YAML), docs/scene.md")->required();
}

int run(int argc, char** argv) {
  CLI::App app("Genu: deformable articular contact in multibody musculoskeletal models.\n", "genu");
  app.set_version_flag("--version", fmt::format("genu {} (Simbody {})", GENU_VERSION, GENU_SIMBODY_VERSION));
  app.require_subcommand(1);
  app.footer(std::string("\nExamples:\n"
                         "  genu check models/artificial_knee/gait.yaml\n"
                         "  genu gait models/artificial_knee/gait.yaml --output gait\n"
                         "  genu replay gait --grid 50x50 --output gait50\n"
                         "`genu COMMAND --help` tells more. ") +
             "\n\n" + kExitCodes);

  CommonOptions common;
  common.commandLine.assign(argv, argv + argc);
  RunOptions runOptions;
  ContactOptions contactOptions;
  ExperimentOptions experimentOptions;
  VerifyCommandOptions verifyOptions;
  std::filesystem::path scene;
  fit::FitOptions fitOptions;
  std::map<const CLI::App*, std::function<int()>> actions;

  CLI::App* command = app.add_subcommand("static", "Find the pose in which contact balances the loads");
  addScene(*command, runOptions.scene);
  addRunOptions(*command, runOptions, "results/SCENE-static", "Elements of every compartment instead of the scene's");
  addCommonOptions(*command, common);
  command->footer(std::string("\nExamples:\n  genu static models/natural_knee/static.yaml --output static\n"
                              "  genu static models/natural_knee/static.yaml --grid 60x45\n\n") +
                  kExitCodes);
  actions[command] = [&] { return runStaticCommand(runOptions, common); };

  command = app.add_subcommand("gait", "Integrate the motion over a cycle");
  addScene(*command, runOptions.scene);
  addRunOptions(*command, runOptions, "results/SCENE-gait", "Elements of every compartment instead of the scene's");
  command->add_flag("--keep-failed", runOptions.keepFailed,
                    "Write what was computed before a failure, marked incomplete");
  command->add_flag("--error-estimate", runOptions.errorEstimate,
                    "Run a second time with a tenth of the tolerances (a fixed step: with the standard integrator) and say what the integration errs by: three to five times the time");
  addCommonOptions(*command, common);
  command->footer(std::string("\nExamples:\n  genu gait models/artificial_knee/gait.yaml --output gait\n"
                              "  genu gait my_knee.yaml --reference measured.csv --progress\n"
                              "  genu gait my_knee.yaml --error-estimate\n\n"
                              "Ctrl-C stops the run; what was computed so far is written and marked incomplete.\n") +
                  kExitCodes);
  actions[command] = [&] { return runGaitCommand(runOptions, common); };

  command = app.add_subcommand("series", "Find one equilibrium after another: slow motion without inertia");
  addScene(*command, runOptions.scene);
  addRunOptions(*command, runOptions, "results/SCENE-series", "Elements of every compartment instead of the scene's");
  command->add_flag("--keep-failed", runOptions.keepFailed,
                    "Write what was computed before a failure, marked incomplete");
  addCommonOptions(*command, common);
  command->footer(std::string("\nExample:\n  genu series models/knee_with_ligaments/natural.yaml --output flexion\n\n"
                              "Times: analysis.series, {duration, output_interval}. Each equilibrium starts from the one before; tables of the\n"
                              "scene are read at each time.\n") +
                  kExitCodes);
  actions[command] = [&] { return runSeriesCommand(runOptions, common); };

  command = app.add_subcommand("experiment", "A classic experiment on a knee with ligaments: " + io::joinNames(listExperiments()));
  command->add_option("NAME", experimentOptions.name, io::joinNames(listExperiments()))->required();
  addScene(*command, experimentOptions.scene);
  command->add_option("-o,--output", experimentOptions.output, "Folder for the results; default: results/SCENE-NAME")->type_name("DIR");
  command->add_option("--grid", experimentOptions.grid, "Elements of every compartment instead of the scene's")->type_name("NXxNZ");
  command->add_option("--joint", experimentOptions.joint, "The floating joint that is the knee, femur in tibia")->capture_default_str();
  command->add_option("--flexion", experimentOptions.flexions_deg, "Flexion angles in deg, as in --flexion 0 30; default: 0 30 60 90, passive-flexion: to 120")->type_name("DEG");
  command->add_option("--load", experimentOptions.load, "Load, in both directions: a number in N or N m, or with a unit; default: drawer 90, varus-valgus 10, rotation 4")->type_name("LOAD");
  command->add_option("--cut", experimentOptions.cut, "Leave out force elements whose names begin so, e.g. ACL")->type_name("PREFIX");
  command->add_flag("--no-plots", experimentOptions.noPlots, "No plots");
  addCommonOptions(*command, common);
  command->footer(std::string("\nExamples:\n  genu experiment passive-flexion models/knee_with_ligaments/natural.yaml\n"
                              "  genu experiment drawer models/knee_with_ligaments/natural.yaml --cut ACL --output acl_cut\n\n"
                              "Bends the knee in steps of 3 deg, then loads it in 18 steps; every step is a static equilibrium.\n"
                              "The scene's own loads stay on; tables over time are refused. Motion is what the tibia does: drawer in mm,\n"
                              "rotations in deg, beside figures of cadavers or volunteers where they were found (docs/experiments.md).\n"
                              "Results: NAME.csv with every step, summary.json, plots/NAME.png.\n") +
                  kExitCodes);
  actions[command] = [&] { return runExperimentCommand(experimentOptions, common); };

  command = app.add_subcommand("verify", "Error against run time: the scene with many integrators, tolerances, grids and rules");
  addScene(*command, verifyOptions.scene)->required(false);
  command->add_flag("--stability", verifyOptions.stability,
                    "Instead: where the scene stops being right as modulus, layer, load, mass, step, ... grow or shrink; without SCENE: built-in scenes");
  command->add_option("-o,--output", verifyOptions.output, "Folder for the results; default: results/SCENE-verify, results/SCENE-stability; without SCENE: results/verify, results/stability")->type_name("DIR");
  command->add_option("--grid", verifyOptions.grid, "Elements of every compartment instead of the scene's")->type_name("NXxNZ");
  command->add_option("--pose-error", verifyOptions.poseError, "Error that the recommended setting may have; default: 0.01 mm")->type_name("LENGTH");
  command->add_option("--force-error", verifyOptions.forceError, "The same for the force of a compartment; default: 5 N")->type_name("FORCE");
  command->add_flag("--full", verifyOptions.full, "All integrators and more grids: some minutes instead of one");
  command->add_flag("--no-plots", verifyOptions.noPlots, "No plots");
  addCommonOptions(*command, common);
  command->footer(std::string("\nExample:\n  genu verify models/artificial_knee/gait.yaml --pose-error \"0.001 mm\"\n"
                              "  genu verify\n  genu verify --stability\n\n"
                              "Without SCENE: built-in scenes, a folder each.\n"
                              "Each setting is compared with a run on a grid twice as fine as the finest, with 100 times tighter steps.\n"
                              "Results: verification.csv, verification.md, summary.json, plots/work_precision.png and .svg (docs/verification.md).\n"
                              "With --stability: stability.csv, stability.md, summary.json, plots/stability_map.png and .svg (docs/stability.md).\n") +
                  kExitCodes);
  actions[command] = [&] { return runVerifyCommand(verifyOptions, common); };

  command = app.add_subcommand("replay", "Evaluate the contact along a finished run, on another grid");
  command->add_option("RESULTS", runOptions.scene, "Results folder of `genu gait`, `genu static`, `genu series` or `genu replay`")
      ->required();
  addRunOptions(*command, runOptions, "RESULTS-replay-NXxNZ",
                "Elements of every compartment; default: the run's scene");
  command->add_flag("--no-error-estimate", runOptions.noErrorEstimate,
                    "No estimates of the error that the grid makes: a quarter of the time");
  addCommonOptions(*command, common);
  command->footer(
      std::string("\nExample:\n  genu replay gait --grid 50x50 --output gait50\n\n"
                  "Every load comes with an estimate of the error that the grid makes (docs/theory.md).\n"
                  "The scene and its inputs are taken from the results folder, as they were during the run.\n") +
      kExitCodes);
  actions[command] = [&] { return runReplayCommand(runOptions, common); };

  command = app.add_subcommand("contact", "Evaluate the contact once, at a given pose");
  addScene(*command, contactOptions.scene);
  command
      ->add_option("--pose", contactOptions.pose,
                   "\"rx, ry, rz, x, y, z\" with units: pose of the moving body in the fixed one, R = Rx Ry Rz")
      ->required()
      ->type_name("POSE");
  command->add_option("--grid", contactOptions.grid, "Elements of every compartment instead of the scene's")
      ->type_name("NXxNZ");
  command->add_flag("--json", contactOptions.json, "JSON on stdout instead of a table");
  command->add_flag("--error", contactOptions.error, "Also estimate the error that the grid makes");
  command
      ->add_option("--adaptive", contactOptions.adaptive,
                   "Refine the grid where it errs until force, torque, peak, mean and area are estimated to be right to "
                   "this share of their values, e.g. 0.001; implies --error")
      ->type_name("TOL");
  command
      ->add_option("--field", contactOptions.field,
                   "Write the elements with pressure, penetration, ... to a .vtp or .csv")
      ->type_name("FILE");
  addThreads(*command, contactOptions.threads);
  addCommonOptions(*command, common);
  command->footer(
      std::string("\nExamples:\n"
                  "  genu contact sphere.yaml --pose \"0 deg, 0 deg, 0 deg, 0 mm, 35.8 mm, 0 mm\"\n"
                  "  genu contact knee.yaml --pose \"0 deg, 2 deg, -30 deg, 0 mm, 33 mm, 0 mm\" --grid 200x200 "
                  "--json --field field.vtp\n\n"
                  "Without contact every number is zero and the exit code 0. Where the pressure has no meaning\n"
                  "(full penetration) there are no numbers and the exit code is 3.\n") +
      kExitCodes);
  actions[command] = [&] { return runContactCommand(contactOptions, common); };

  command = app.add_subcommand("fit", "Fit one NURBS patch to a region of a triangle mesh");
  fit::addFitOptions(*command, fitOptions);
  command->add_flag("-q,--quiet", common.console.quiet, "Errors only");
  command->add_flag("-v,--verbose", common.console.verbose, "More messages");
  command->add_flag("--progress", common.console.progress, "Progress lines also where stderr is not a terminal");
  actions[command] = [&] {
    installInterruptHandler(true);
    ProgressMeter meter("fit", common.console);
    fit::runFitCommand(fitOptions, meter.callback());
    return static_cast<int>(kOk);
  };

  command = app.add_subcommand("check", "Read and build everything a scene needs; run nothing");
  addScene(*command, scene);
  addCommonOptions(*command, common);
  command->footer(std::string("\nExample:\n  genu check my_knee.yaml\n\n") + kExitCodes);
  actions[command] = [&] { return runCheckCommand(scene, common); };

  command = app.add_subcommand("explain", "Tell what a scene includes, and what was left out because nothing needs it");
  addScene(*command, scene);
  addCommonOptions(*command, common);
  command->footer(std::string("\nExample:\n  genu explain my_knee.yaml\n\n") + kExitCodes);
  actions[command] = [&] { return runExplainCommand(scene, common); };

  if (argc > 1 && argv[1][0] != '-') {
    std::vector<std::string> names;
    for (const auto* subcommand : app.get_subcommands(nullptr)) names.push_back(subcommand->get_name());
    if (std::find(names.begin(), names.end(), argv[1]) == names.end()) {
      throw InputError(io::describeUnknown("command", argv[1], names));
    }
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kBadInput;
  }
  setUpLog(common.console);
  if (common.dataFolder.empty()) {
    if (const char* folder = std::getenv("GENU_DATA_DIR")) common.dataFolder = folder;
  } else if (!std::filesystem::is_directory(common.dataFolder)) {
    throw InputError(fmt::format("--data \"{}\": no such folder", common.dataFolder.string()));
  }
  return actions.at(app.get_subcommands().front())();
}

}  // namespace

int runProgram(int argc, char** argv) {
  // Before the options are known a message goes out plainly.
  const auto fail = [](const std::string& message, ExitCode code) {
    fmt::print(stderr, "error: {}\n", message);
    return static_cast<int>(code);
  };
  try {
    return run(argc, argv);
  } catch (const InputError& e) {
    return fail(e.what(), kBadInput);
  } catch (const ComputationError& e) {
    return fail(e.what(), kComputationFailed);
  } catch (const std::bad_alloc&) {
    return fail("not enough memory; a coarser grid needs less", kComputationFailed);
  } catch (const std::exception& e) {
    return fail(std::string("internal: ") + e.what(), kInternalError);
  }
}

}  // namespace genu::app
