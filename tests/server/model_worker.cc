// A fake of pepeseg-worker for tests that need a model, but no training. The model has two flat
// squares of Gaussians, red on the left with one feature and blue on the right with another, and
// three views. The name of the dataset's first file changes it:
//   NUMBER.model   the squares are NUMBER pixels of the views further to the right
//   far.model      everything is at map coordinates, far from zero
//   bare           no features, as if trained without masks
//   hang           the job never ends
//   half.model     the views are of photographs twice as large
//   by_sam.model   as half.model, and the masks were SAM's
//   lens.model     those photographs were taken by a lens that distorts
//   turned.model   those photographs lie on their side
//   wide.model     eight views, 0.jpg to 7.jpg, of eight sizes from 560x420 to 784x588
//   many.model     120 views, 0.jpg to 119.jpg, every second one held out
//   large.model    four times as many Gaussians, of SH degree 3
// Photographs are decoded, and text commands run, by the worker that PEPESEG_WORKER names.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "core/model_files/model_file.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {
namespace {

constexpr int kSide = 100;           // Gaussians along a square's side
constexpr int kLargeSide = 200;      // the same in "large.model"
constexpr float kShOfColour = 3.5f;  // about 1 / 0.282: the SH coefficient of a full colour channel

// Sets one square: half of the model's Gaussians, from `first` on.
void AddSquare(float left, int channel, int64_t first, Model& model) {
  Gaussians& gaussians = model.gaussians;
  const auto side = std::lround(std::sqrt(gaussians.count / 2));
  for (int64_t i = first; i < first + side * side; ++i) {
    const int64_t of_row = (i - first) % side, of_column = (i - first) / side;
    const auto column = static_cast<float>(of_row), row = static_cast<float>(of_column);
    gaussians.Plane(kMeanPlane)[i] = left + column / static_cast<float>(side);
    gaussians.Plane(kMeanPlane + 1)[i] = row / static_cast<float>(side) - 0.5f;
    gaussians.Plane(kMeanPlane + 2)[i] = 2;
    for (int k = 0; k < 3; ++k) gaussians.Plane(kLogScalePlane + k)[i] = std::log(0.01f);
    gaussians.Plane(kRotationPlane)[i] = 1;
    gaussians.Plane(kOpacityPlane)[i] = 4;
    for (int k = 0; k < 3; ++k) {
      gaussians.Plane(kShPlane + k)[i] = (k == channel ? 0.5f : -0.5f) * kShOfColour;
    }
    model.field.features[32 * i + channel] = 1;
  }
}

ModelView MakeView(const std::string& name, double x, bool held_out) {
  ModelView view;
  view.name = name;
  view.camera = {96, 64, 60, 60, 48, 32};
  view.cam_from_world.translation = Eigen::Vector3d(-x, 0, 0);
  view.held_out = held_out;
  return view;
}

Model MakeModel(float shift, int64_t side, int sh_degree) {
  Model model;
  model.gaussians = Gaussians::Zero(2 * side * side, sh_degree);
  model.field.features.assign(static_cast<size_t>(model.gaussians.count) * 32, 0.0f);
  for (int i = 0; i < 1000; ++i)
    model.field.scale_quantiles.push_back(0.001f * static_cast<float>(i + 1));
  AddSquare(-1.1f + shift, 0, 0, model);
  AddSquare(0.1f + shift, 2, side * side, model);
  model.views = {MakeView("left/0.jpg", -0.1, true), MakeView("middle.jpg", 0, false),
                 MakeView("right.jpg", 0.1, true)};
  model.metrics["psnr"] = 30;
  return model;
}

// Views of different sizes: their feature maps, of 15 to 30 MB, fragment a heap that keeps them.
std::vector<ModelView> MakeWideViews() {
  constexpr int kNumViews = 8;
  std::vector<ModelView> views;
  views.reserve(kNumViews);
  for (int i = 0; i < kNumViews; ++i) {
    ModelView view = MakeView(std::to_string(i) + ".jpg", 0.02 * i, i % 2 != 0);
    const int width = 560 + 32 * (i * 3 % kNumViews), height = width / 4 * 3;
    view.camera = {width, height, 0.6 * width, 0.6 * width, 0.5 * width, 0.5 * height};
    views.push_back(view);
  }
  return views;
}

std::vector<ModelView> MakeManyViews() {
  constexpr int kNumViews = 120;
  std::vector<ModelView> views;
  views.reserve(kNumViews);
  for (int i = 0; i < kNumViews; ++i) {
    views.push_back(MakeView(std::to_string(i) + ".jpg", 0.001 * i, i % 2 != 0));
  }
  return views;
}

// Makes a view as the import does at image_scale 0.5.
void SetPhotographs(const std::string& name, Model& model) {
  for (ModelView& view : model.views) {
    Photograph photograph;
    photograph.lens = {LensModel::kSimpleRadial, 192, 128, 120, 120, 96, 64, {}};
    if (name == "lens.model") photograph.lens.distortion[0] = -0.2;
    if (name == "turned.model") photograph.orientation = 6;
    photograph.width = 192;
    photograph.height = 128;
    view.photograph = photograph;
  }
}

int Run(const std::string& path) {
  const JobFolder folder(path);
  const auto spec = folder.ReadSpec(folder.NewestFence());
  if (!spec.ok()) return static_cast<int>(WorkerExit::kBadSpec);
  const std::string name = spec->files.empty() ? "" : spec->files[0].name;
  while (name == "hang") pause();  // until a signal ends it
  const float shift = name.ends_with(".model") ? std::strtof(name.c_str(), nullptr) / 30.0f : 0.0f;
  const bool large = name == "large.model";
  Model model = MakeModel(shift, large ? kLargeSide : kSide, large ? kMaxShDegree : 0);
  if (name == "far.model") model.origin = {4e5, 5.3e6, 100};
  if (name == "bare") model.field = {};
  if (name == "many.model") model.views = MakeManyViews();
  if (name == "wide.model") model.views = MakeWideViews();
  if (name == "half.model" || name == "by_sam.model" || name == "lens.model" ||
      name == "turned.model") {
    SetPhotographs(name, model);
  }
  if (name == "by_sam.model") model.facts["masks"] = "sam";
  const std::filesystem::path attempt = folder.attempt(spec->fence);
  std::error_code error;
  std::filesystem::create_directories(attempt, error);
  JobResult result;
  result.status = WriteModel(attempt, model);
  result.metrics = model.metrics;
  result.num_gaussians = model.gaussians.count;
  result.num_bytes = 1;
  const WorkerExit exit = result.status.ok() ? WorkerExit::kSucceeded : WorkerExit::kFailed;
  return folder.WriteResult(spec->fence, result).ok() ? static_cast<int>(exit) : 99;
}

}  // namespace
}  // namespace pepeseg

int main(int argc, char** argv) {
  const std::string flag = argc > 1 ? argv[1] : "";
  if (flag.starts_with("--photograph=") || flag.starts_with("--text="))
    return execv(PEPESEG_WORKER, argv);
  return flag.starts_with("--job=") ? pepeseg::Run(flag.substr(6)) : 96;
}
