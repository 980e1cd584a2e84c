#include "core/train/early_field.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/features/estimate.h"
#include "core/features/mask_scales.h"
#include "core/features/trainer.h"
#include "core/model_files/model_file.h"
#include "core/reconstruct/estimate.h"
#include "core/train/model_writing.h"

namespace pepeseg {
namespace {

// The Gaussians are copied once each photograph was seen this often, as far as that is between
// these shares of stage one's steps. tests/bench/results/snapshots.md has what was measured.
constexpr int64_t kVisits = 18, kFirstPercent = 15, kLastPercent = 55;
constexpr int64_t kLatestPercent = 70;  // a training that resumes later gets no field
constexpr int kLeastSteps = 1000;  // of stage one; a shorter one ends before the field is there
constexpr size_t kMostViews = 64;  // that the field learns from
constexpr int kFieldSteps = 960;   // of the field
// Least opacity of Gaussians, and most degrees of their harmonics, that are kept: the model is to
// be trained, written and read soon.
constexpr float kLeastOpacity = 0.04f;
constexpr int kShDegree = 1;

// Returns the view without what perception alone reads.
View WithoutCues(const View& view) {
  View light;
  light.name = view.name;
  light.camera = view.camera;
  light.cam_from_world = view.cam_from_world;
  light.ignore = view.ignore;
  light.masks = view.masks;
  return light;
}

// Returns the capture with some of the views alone that stage two learns from, at even distances.
Capture FewViews(const Capture& capture) {
  const std::vector<int> trained = TrainedViews(capture);
  Capture few;
  few.points = capture.points;
  few.origin = capture.origin;
  const size_t num = std::min(kMostViews, trained.size());
  for (size_t i = 0; i < num; ++i) {
    few.views.push_back(WithoutCues(capture.views[trained[i * trained.size() / num]]));
  }
  return few;
}

// Leaves out what a short training has no time for, or no use.
FeatureOptions ShortOptions(FeatureOptions options) {
  options.num_steps = std::min(kFieldSteps, options.num_steps);
  options.perception_weight = 0;
  options.centroid_weight_upper = 0;
  options.centroid_weight_lower = 0;
  return options;
}

// Returns the step of stage one, of num_steps on num_views photographs, after which the Gaussians
// are copied.
int64_t DueStep(int64_t num_views, int64_t num_steps) {
  return std::clamp(kVisits * num_views, num_steps * kFirstPercent / 100,
                    num_steps * kLastPercent / 100);
}

// Returns the Gaussians that show, with few degrees. The planes of the higher degrees come last.
Gaussians ThatShow(Gaussians gaussians) {
  gaussians.sh_degree = std::min(gaussians.sh_degree, kShDegree);
  gaussians.planes.resize(static_cast<size_t>(NumPlanes(gaussians.sh_degree) * gaussians.count));
  const float least = std::log(kLeastOpacity / (1 - kLeastOpacity));
  const std::span<const float> logits = std::as_const(gaussians).Plane(kOpacityPlane);
  std::vector<int64_t> rows;
  for (int64_t i = 0; i < gaussians.count; ++i) {
    if (logits[i] >= least) rows.push_back(i);
  }
  return gaussians.Select(rows);
}

}  // namespace

std::unique_ptr<Backend> QueueForEarlyField(const Backend& backend, const Capture& capture,
                                            const ReconstructOptions& reconstruct,
                                            const FeatureOptions& features) {
  if (backend.queue_depth() == 0 || !std::ranges::any_of(capture.views, IsTrained)) return nullptr;
  if (reconstruct.num_steps < kLeastSteps) return nullptr;
  const TrainingSize size = SizeOf(capture);
  const int64_t need =
      EstimateReconstruct(backend, size, reconstruct).device_bytes +
      TypicalFeatureDeviceBytes(backend, MostGaussians(size, reconstruct), size.max_pixels,
                                kShDegree, ShortOptions(features));
  if (backend.memory().free_bytes < need) return nullptr;
  return backend.MakeTwin(QueuePriority::kFirst);
}

EarlyField::EarlyField(Scene scene, GaussianTrainer& trainer, std::unique_ptr<Backend> twin,
                       TrainingObserver& observer)
    : scene_(std::move(scene)),
      trainer_(trainer),
      twin_(std::move(twin)),
      observer_(observer),
      num_views_(SizeOf(scene_.capture).num_training_views),
      wanted_(twin_ != nullptr && observer.FirstSnapshotSeconds().has_value()) {}

EarlyField::~EarlyField() {
  stopped_ = true;
  if (made_.valid()) made_.wait();
}

void EarlyField::Advance(const StepReport& report) {
  if (made_.valid() && made_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    const absl::Status made = made_.get();
    observer_.Log(made.ok() ? "the early field answers clicks"
                            : absl::StrCat("no early field: ", made.ToString()));
  }
  if (!wanted_ || report.step < DueStep(num_views_, report.num_steps)) return;
  wanted_ = false;
  if (100 * report.step > kLatestPercent * report.num_steps) return;
  made_ = std::async(std::launch::async, [this, report, gaussians = trainer_.Result()]() mutable {
    try {
      return Make(ThatShow(std::move(gaussians)), report);
    } catch (const std::bad_alloc&) {  // of the standard library
      return absl::Status(absl::ResourceExhaustedError("the machine is out of memory"));
    }
  });
}

absl::Status EarlyField::Make(Gaussians gaussians, const StepReport& at) const {
  const Capture few = FewViews(scene_.capture);
  Model model = scene_.described;
  model.gaussians = std::move(gaussians);
  model.metrics[kEarlyStep] = static_cast<double>(at.step);
  model.metrics[kEarlyNumSteps] = static_cast<double>(at.num_steps);
  ASSIGN_OR_RETURN(const auto trainer, FeatureTrainer::Create(*twin_, few, model.gaussians,
                                                              ShortOptions(scene_.features)));
  while (!trainer->done()) {
    if (stopped_) return absl::CancelledError("stage one has ended");
    RETURN_IF_ERROR(trainer->Step().status());
  }
  model.field = trainer->Result();
  if (const std::string error = twin_->error(); !error.empty()) return absl::InternalError(error);
  return WriteModelTo(scene_.folder, model);
}

}  // namespace pepeseg
