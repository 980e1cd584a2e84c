#include "core/reconstruct/refiner.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

constexpr int kMostVisits = 2;  // longest window, in steps for each training view

int CountTrainingViews(const Capture& capture) {
  return static_cast<int>(std::count_if(capture.views.begin(), capture.views.end(),
                                        [](const View& view) { return !view.held_out; }));
}

}  // namespace

ViewMasks::ViewMasks(Backend& backend, const Capture& capture, MemoryPlace place) {
  for (const View& view : capture.views) {
    if (!view.held_out) views_.push_back(Upload(backend, view.masks, place));
  }
}

// Clears allocated_ when the backend is out of memory.
ViewMasks::Masks ViewMasks::Upload(Backend& backend, const MaskSet& masks, MemoryPlace place) {
  Masks out;
  if (masks.empty()) return out;
  any_ = true;
  const auto upload = [&]<class T>(const std::vector<T>& host, Buffer<T>& buffer) {
    const auto size = static_cast<int64_t>(host.size());
    buffer = Buffer<T>(backend, size, place);
    if (buffer.size() == size) {
      buffer.Upload(host);
    } else {
      allocated_ = false;
    }
  };
  out.words = masks.words;
  upload(masks.pixel_cell, out.pixel_cell);
  upload(masks.cell_bits, out.cell_bits);
  upload(masks.mask_area, out.mask_area);
  return out;
}

PatchMap ViewMasks::At(int view) const {
  const Masks& masks = views_[view];
  return {masks.words, masks.pixel_cell.span(), masks.cell_bits.span(), masks.mask_area.span()};
}

// The window's start and length are shares of num_steps. A start at which photographs are still
// smaller is moved to the first step at full size; the length is limited to kMostVisits steps for
// each training view.
Refiner::Refiner(Backend& backend, const Capture& capture, const ReconstructOptions& options,
                 const Schedule& schedule, MemoryPlace place)
    : backend_(backend), options_(options) {
  if (options.refine_keep == RefineKeep::kNone) return;
  masks_.emplace(backend, capture, place);
  if (!masks_->any()) masks_.reset();
  const auto step_of = [&](double share) {
    return static_cast<int>(std::lround(share * options.num_steps));
  };
  first_ = step_of(options.refine_from);
  while (first_ < options.num_steps && schedule.ShrinkAt(first_) != 1) ++first_;
  const int longest = kMostVisits * CountTrainingViews(capture);
  end_ = std::min(first_ + std::min(longest, step_of(options.refine_length)), options.num_steps);
}

bool Refiner::Due(int step) const { return masks_ && step >= first_ && step < end_; }

// The render gives the depth that candidates are compared with and the list of visible Gaussians.
// RefineGaussians then shortens them in place; their outside parts, with RefineKeep::kSplit, are
// appended here.
absl::Status Refiner::Apply(const Target& target, GaussianState& state) {
  if (!working_) working_.emplace();
  if (!state.refinement_open() && !state.OpenRefinement()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("refinement: out of memory for ", state.count(), " Gaussians"));
  }
  if (!masks_->HasMasks(target.view)) return absl::OkStatus();
  Render(target, state);
  const RefineGaussiansArgs args = MakeArgs(target, state);
  std::array<int64_t, kNumRefineCounts> counts = {};
  if (backend_.error().empty()) {
    backend_.RefineGaussians(args);
    working_->counts.Download(counts);
  }
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::ResourceExhaustedError(absl::StrCat("refinement: ", error));
  }
  counts_.num_refined += counts[kNumRefined];
  counts_.num_split += counts[kNumRefineSplit];
  if (!state.Append(args.outside_source.Subspan(0, counts[kNumRefineSplit]), args.outside_shape)) {
    return absl::ResourceExhaustedError(
        absl::StrCat("refinement: out of memory for ", counts[kNumRefineSplit], " more Gaussians"));
  }
  return absl::OkStatus();
}

// Renders alpha and depth; RefineGaussians reads them and the list of visible Gaussians.
void Refiner::Render(const Target& target, GaussianState& state) {
  const int64_t num_pixels = int64_t{target.pinhole.width} * target.pinhole.height;
  working_->color.Reserve(backend_, 3 * num_pixels);
  working_->alpha.Reserve(backend_, num_pixels);
  working_->depth.Reserve(backend_, num_pixels);
  if (!backend_.error().empty()) return;
  backend_.Render({.gaussians = state.parameters(),
                   .view = target.pinhole,
                   .near_plane = target.near_plane,
                   .active_sh_degree = 0,  // the colours are not used
                   .scratch = &working_->render,
                   .color = working_->color.span(),
                   .alpha = working_->alpha.span(),
                   .depth = working_->depth.span(),
                   .for_backward = false});
}

// Outside parts are limited by the candidates and by what max_gaussians leaves.
RefineGaussiansArgs Refiner::MakeArgs(const Target& target, GaussianState& state) {
  const bool split = options_.refine_keep == RefineKeep::kSplit;
  const auto most =
      static_cast<int64_t>(options_.refine_candidates * static_cast<double>(state.count()));
  const int64_t room =
      split ? std::clamp<int64_t>(options_.max_gaussians - state.count(), 0, most) : 0;
  working_->outside_source.Reserve(backend_, room);
  // A mean and three log-scales for each part.
  working_->outside_shape.Reserve(backend_, 6 * room);
  working_->counts.Reserve(backend_, kNumRefineCounts);
  return {.view = target.pinhole,
          .masks = masks_->At(target.view),
          .alpha = working_->alpha.span(),
          .depth = working_->depth.span(),
          .candidate_share = options_.refine_candidates,
          .split = split,
          .render = &working_->render,
          .scratch = &working_->refine,
          .gaussians = state.parameters(),
          .moment1 = state.moment1(),
          .moment2 = state.moment2(),
          .num_steps = state.num_steps(),
          .refinable = state.refinable(),
          .outside_source = working_->outside_source.span(),
          .outside_shape = working_->outside_shape.span(),
          .counts = working_->counts.span()};
}

// Frees the memory also when the schedule position has jumped over the end of the window.
void Refiner::EndStep(int step, GaussianState& state) {
  if (!masks_ || step + 1 < end_) return;
  masks_.reset();
  working_.reset();
  state.CloseRefinement();
}

}  // namespace pepeseg
