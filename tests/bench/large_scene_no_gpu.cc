#include "tests/bench/large_scene.h"

// In place of large_scene_photographer.cu in builds without CUDA.

namespace pepeseg {

ScenePhotographer::ScenePhotographer(const LargeScene& /*scene*/) {}
ScenePhotographer::~ScenePhotographer() = default;
ScenePicture ScenePhotographer::Photograph(const SceneCamera& /*camera*/) { return {}; }

}  // namespace pepeseg
