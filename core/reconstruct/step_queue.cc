#include "core/reconstruct/step_queue.h"

#include <algorithm>
#include <functional>
#include <vector>

namespace pepeseg {
namespace {

// Pixels in flight that fill an H200; more steps at once only take memory.
constexpr int64_t kPixelsAtOnce = 1'000'000;
constexpr int64_t kMostAtOnce = 4;

}  // namespace

int StepsAtOnce(int num_branches, const ReconstructOptions& options, int64_t max_pixels) {
  if (options.depth_weight > 0) return 1;
  if (options.views_at_once > 0) return options.views_at_once;
  const int64_t needed = kPixelsAtOnce / std::max<int64_t>(1, max_pixels);
  const int64_t most = std::min<int64_t>(kMostAtOnce, num_branches);
  return static_cast<int>(std::clamp<int64_t>(needed, 1, most));
}

std::vector<int64_t> SlotPixels(const Backend& backend, const ReconstructOptions& options,
                                int64_t max_pixels) {
  std::vector<int64_t> pixels;
  for (const int shrink : {1, 2, 4}) {  // see Schedule::ShrinkAt
    if (shrink > 1 && options.coarse_until <= 0) break;
    const int64_t most = max_pixels / (int64_t{shrink} * shrink);
    const auto num_steps = static_cast<size_t>(StepsAtOnce(backend.num_branches(), options, most));
    if (num_steps > pixels.size()) pixels.resize(num_steps, most);
  }
  return pixels;
}

StepQueue::StepQueue(Backend& backend, const PreparedScene& scene, DepthTerm& depth_term,
                     GaussianState& gaussians)
    : backend_(backend),
      scene_(scene),
      depth_term_(depth_term),
      gaussians_(gaussians),
      slots_(MakeSlots(backend, scene)),
      results_(backend, static_cast<int>(slots_.size())),
      entry_capacities_(scene.views.size()) {}

std::deque<StepQueue::Slot> StepQueue::MakeSlots(Backend& backend, const PreparedScene& scene) {
  std::deque<Slot> slots;
  for (const int64_t pixels : SlotPixels(backend, scene.options, scene.views.max_pixels())) {
    slots.emplace_back(backend, pixels);
  }
  return slots;
}

int StepQueue::steps_at_once(int shrink) const {
  const int64_t pixels = scene_.views.max_pixels() / (int64_t{shrink} * shrink);
  return StepsAtOnce(backend_.num_branches(), scene_.options, pixels);
}

bool StepQueue::allocated() const {
  return results_.allocated() && std::ranges::all_of(slots_, [](const Slot& slot) {
           return !slot.color.empty() && !slot.color_grad.empty() && !slot.loss_sums.empty();
         });
}

// Returns the SH degree in use: degrees may have been pruned.
int StepQueue::ShDegreeAt(int position) const {
  return std::min(scene_.schedule.ShDegreeAt(position), gaussians_.sh_degree());
}

void StepQueue::Train(std::span<const StepInput> steps) {
  std::vector<int64_t> entry_capacities;
  for (const StepInput& step : steps) entry_capacities.push_back(entry_capacities_.For(step));
  Queue(steps, entry_capacities);
}

std::optional<StepResult> StepQueue::Pop() {
  const StepResult result = results_.Pop();
  if (result.overflowed) {
    constexpr int64_t kWaitForCount = 0;  // no capacity: the host waits for the count of entries
    Queue({&result.input, 1}, {&kWaitForCount, 1});
    return std::nullopt;
  }
  entry_capacities_.Record(result);
  return result;
}

// With tile-entry capacities nothing waits, so that the backend can replay the steps as a CUDA
// graph: one for each number of steps and size of the photographs, with and without depth. With a
// capacity of 0 the host waits for the count of entries.
void StepQueue::Queue(std::span<const StepInput> steps, std::span<const int64_t> entry_capacities) {
  std::vector<std::function<void()>> gradients;
  for (size_t k = 0; k < steps.size(); ++k) {
    gradients.push_back([&, k] {
      QueueGradient(steps[k], ShDegreeAt(steps.front().position), entry_capacities[k], slots_[k]);
    });
  }
  const auto ops = [&] {
    backend_.Branches(gradients);
    QueueUpdates(steps);
  };
  const bool waits = std::ranges::find(entry_capacities, 0) != entry_capacities.end();
  if (waits) {
    ops();
  } else {
    const int num_steps = static_cast<int>(steps.size());
    const int depth = steps.front().depth.weight > 0 ? 1 : 0;
    constexpr int kKinds = 16;  // of steps: 2 * shrink + depth
    backend_.Sequence(kKinds * num_steps + 2 * steps.front().shrink + depth, ops);
  }
  for (size_t k = 0; k < steps.size(); ++k) {
    results_.Push(steps[k], static_cast<int>(k), slots_[k].loss_sums.span(),
                  slots_[k].scratch.counters.span());
  }
}

// Forward pass, loss and backward pass on one view.
void StepQueue::QueueGradient(const StepInput& input, int sh_degree, int64_t entry_capacity,
                              Slot& slot) {
  const TrainingView& view = scene_.views.At(input.view, input.shrink);
  const int64_t size = 3 * int64_t{view.pinhole.width} * view.pinhole.height;
  const auto color = slot.color.span().Subspan(0, size);
  const auto color_grad = slot.color_grad.span().Subspan(0, size);
  const DepthImages depth = depth_term_.ImagesFor(view, input.depth);

  backend_.Render({.gaussians = gaussians_.parameters(),
                   .view = view.pinhole,
                   .near_plane = scene_.near_plane,
                   .active_sh_degree = sh_degree,
                   .dropout = input.dropout,
                   .scratch = &slot.scratch,
                   .color = color,
                   // Empty where the step has no depth term.
                   .alpha = depth.alpha,
                   .depth = depth.depth,
                   .inverse_depth = depth.inverse_depth,
                   .tile_entry_capacity = entry_capacity});
  backend_.ImageLoss({.width = view.pinhole.width,
                      .height = view.pinhole.height,
                      .color = color,
                      .target = view.photo.span(),
                      .ignore = view.ignore.span(),
                      .ssim_weight = scene_.options.ssim_weight,
                      .color_grad = color_grad,
                      .sums = slot.loss_sums.span().Subspan(0, kNumImageLossSums)});
  depth_term_.Compare(view, input.depth,
                      slot.loss_sums.span().Subspan(kFirstDepthSum, kNumDepthLossSums));
  backend_.RenderBackward({.view = view.pinhole,
                           .color_grad = color_grad,
                           .alpha_grad = depth.alpha_grad,
                           .depth_grad = depth.depth_grad,
                           .scratch = &slot.scratch});
}

// A step of Adam for each gradient in the slots. The rates are those of the first of them.
void StepQueue::QueueUpdates(std::span<const StepInput> steps) {
  std::vector<UpdateStep> updates;
  for (size_t k = 0; k < steps.size(); ++k) {
    updates.push_back({.view = scene_.views.At(steps[k].view, steps[k].shrink).pinhole,
                       .dropout = steps[k].dropout,
                       .scratch = &slots_[k].scratch});
  }
  const int position = steps.front().position;
  backend_.Update({.steps = updates,
                   .active_sh_degree = ShDegreeAt(position),
                   .learning_rates = scene_.schedule.RatesAt(position),
                   .beta2 = scene_.options.second_moment_decay,
                   .min_log_scale = scene_.log_scales.min,
                   .max_log_scale = scene_.log_scales.max,
                   .gaussians = gaussians_.parameters(),
                   .moment1 = gaussians_.moment1(),
                   .moment2 = gaussians_.moment2(),
                   .num_steps = gaussians_.num_steps(),
                   .stats = gaussians_.stats()});
}

}  // namespace pepeseg
