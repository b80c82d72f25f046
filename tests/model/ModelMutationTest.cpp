#include <gtest/gtest.h>

#include "../fuzz/Mutate.h"
#include "ElementFixtures.h"
#include "genu/io/Files.h"
#include "genu/model/UrdfModel.h"

namespace genu::model {
namespace {

std::string readFuzzFile(const char* name) { return io::readFile(std::filesystem::path(GENU_SOURCE_DIR) / "tests" / "fuzz" / name); }

scene::Scene parse(const std::string& text) { return scene::parseScene(text, GENU_SOURCE_DIR "/tests/fuzz/files/scene.yaml"); }

using Mutation = std::string (*)(std::string, std::mt19937&);

// The scene's reader does not open the URDF file; links, joints and paths meet here. Any answer but a model, an InputError or a
// ComputationError (a muscle without equilibrium) fails. Many mutations change a number or a space only: those must be read.
int countModels(const std::string& seed, Mutation mutation, unsigned randomSeed, int runs, void (*build)(const std::string&)) {
  std::mt19937 random(randomSeed);
  int read = 0;
  for (int i = 0; i < runs; ++i) {
    const std::string text = mutation(seed, random);
    try {
      build(text);
      ++read;
    } catch (const InputError&) {
    } catch (const ComputationError&) {
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what() << "\n" << text;
      break;
    }
  }
  return read;
}

void buildWithUrdf(const std::string& text) {
  static const scene::Scene seed = parse(readFuzzFile("corpus/scene/elements.yaml"));
  const testing_support::TemporaryFile file("mutated.urdf", text);
  scene::Scene scene = seed;
  scene.model->urdf = file.path();
  const KneeSystem knee(scene);
}

void buildWithScene(const std::string& text) {
  const scene::Scene scene = parse(text);
  if (!scene.model) throw InputError("no model");
  KneeSystem knee(scene);
  SimTK::State state = knee.system().realizeTopology();
  knee.system().realizeModel(state);
  knee.system().realize(state, SimTK::Stage::Dynamics);
}

TEST(ModelMutation, WrongUrdf) {
  const std::string urdf = readFuzzFile("files/leg.urdf");
  EXPECT_GT(countModels(urdf, fuzz::mutate, 1, 1500, buildWithUrdf), 10);
  EXPECT_GT(countModels(urdf, fuzz::mutateNumbers, 2, 500, buildWithUrdf), 100);
}

TEST(ModelMutation, WrongElements) {
  const std::string seed = readFuzzFile("corpus/scene/elements.yaml");
  EXPECT_GT(countModels(seed, fuzz::mutate, 3, 1000, buildWithScene), 10);
  EXPECT_GT(countModels(seed, fuzz::mutateNumbers, 4, 300, buildWithScene), 60);
}

}  // namespace
}  // namespace genu::model
