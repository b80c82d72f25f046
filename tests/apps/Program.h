#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace genu::app::testing {

namespace fs = std::filesystem;

struct Outcome {
  int exitCode = -1;  ///< -1: ended by a signal
  std::string out, err;
};

/** Runs the built program in a folder of the test's own. */
class ProgramTest : public ::testing::Test {
 protected:
  ProgramTest() {
    std::string name = (fs::temp_directory_path() / "genu-apps-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = name;
    unsetenv("GENU_DATA_DIR");
  }
  ~ProgramTest() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  void write(const std::string& name, const std::string& text) const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }

  std::vector<std::string> listFolder() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_)) names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }

  /** `interruptAt`: SIGINT is sent once stderr holds this text. */
  Outcome run(std::vector<std::string> arguments, const std::string& interruptAt = {}) const {
    int out[2], err[2];
    if (pipe2(out, O_CLOEXEC) != 0 || pipe2(err, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addchdir_np(&actions, folder_.c_str());
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, out[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, err[1], STDERR_FILENO);
    arguments.insert(arguments.begin(), GENU_PROGRAM);
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_t child = -1;
    const int error = posix_spawn(&child, GENU_PROGRAM, &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(out[1]);
    close(err[1]);
    if (error != 0) throw std::runtime_error("the program does not start");

    Outcome outcome;
    pollfd pipes[2] = {{out[0], POLLIN, 0}, {err[0], POLLIN, 0}};
    std::string* texts[2] = {&outcome.out, &outcome.err};
    bool sent = interruptAt.empty();
    for (int open = 2; open > 0;) {
      poll(pipes, 2, -1);
      for (int i = 0; i < 2; ++i) {
        if (pipes[i].fd < 0 || pipes[i].revents == 0) continue;
        char buffer[4096];
        const ssize_t size = read(pipes[i].fd, buffer, sizeof(buffer));
        if (size > 0) {
          texts[i]->append(buffer, static_cast<size_t>(size));
        } else {
          close(pipes[i].fd);
          pipes[i].fd = -1;
          --open;
        }
      }
      if (!sent && outcome.err.find(interruptAt) != std::string::npos) {
        kill(child, SIGINT);
        sent = true;
      }
    }
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFEXITED(status)) outcome.exitCode = WEXITSTATUS(status);
    return outcome;
  }

  fs::path folder_;
};

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  if (at == std::string::npos) throw std::runtime_error("\"" + from + "\" is not in the text");
  return text.replace(at, from.size(), to);
}

/** Sphere R = 30 mm on a flat layer of 6 mm. */
inline const char* kBall = R"(genu: 1
surfaces:
  layer: {plane: {y0: 6 mm}}
  ball: {sphere: {R: 30 mm}}
materials:
  polyethylene: {E: 463 MPa, nu: 0.46}
contact:
  knee:
    fixed: {surface: layer, thickness: 6 mm}
    moving: {surface: ball}
    material: polyethylene
    compartments: {all: {rectangle: "-5 mm, 5 mm, -5 mm, 5 mm", grid: 50x50}}
)";

/** Two tori on two dishes; needs knee.urdf and gait.csv. */
inline const char* kKnee = R"(genu: 1
name: test knee
surfaces:
  dish_m: {dish: {y0: 8 mm, Rs: 60 mm, Rf: 40 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, 0 mm, 22 mm", extent: 18 mm}
  dish_l: {dish: {y0: 8 mm, Rs: 60 mm, Rf: 40 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, 0 mm, -22 mm", extent: 18 mm}
  condyle_m: {torus: {Rs: 30 mm, Rf: 22 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, 0 mm, 22 mm"}
  condyle_l: {torus: {Rs: 30 mm, Rf: 22 mm}, pose: "0 deg, 0 deg, 0 deg, 0 mm, 0 mm, -22 mm"}
materials:
  polyethylene: {E: 463 MPa, nu: 0.46}
contact:
  knee:
    fixed: {thickness: {height_above: 0 mm}}
    moving: {}
    material: polyethylene
    compartments:
      medial: {rectangle: "-15 mm, 15 mm, 9 mm, 35 mm", grid: 20x20, fixed: dish_m, moving: condyle_m}
      lateral: {rectangle: "-15 mm, 15 mm, -35 mm, -9 mm", grid: 20x20, fixed: dish_l, moving: condyle_l}
model:
  urdf: knee.urdf
  joint: knee
  coordinates:
    rz: {prescribed: {table: gait.csv, column: rz, unit: deg}}
    ry: {prescribed: 0 deg}
    x: {prescribed: 0 mm}
    y: free
    z: {free: {damping: 50 N s/m}}
loads:
  axial:
    body: femur
    frame: tibia
    force: [0 N, {table: gait.csv, column: load, unit: N, scale: -1}, 0 N]
    point: {at: "0 mm, 0 mm, 8.8 mm"}
analysis:
  gait: {duration: 0.2 s, output_interval: 10 ms}
)";

inline const char* kUrdf = R"(<robot name="knee">
  <link name="tibia"/>
  <link name="femur"><inertial><mass value="3"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="knee" type="floating"><parent link="tibia"/><child link="femur"/></joint>
</robot>
)";

inline const char* kTable = "time,rz,load\n0,0,300\n0.05,-5,800\n0.1,-10,2000\n0.15,-15,900\n0.2,-20,400\n";

}  // namespace genu::app::testing
