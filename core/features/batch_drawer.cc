#include "core/features/batch_drawer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/random_state.h"
#include "core/features/mask_scales.h"
#include "core/features/random_draws.h"
#include "kernels/ops/smooth.h"
#include "kernels/thread_pool.h"

namespace pepeseg {
namespace {

// Returns a word in which `count` of the lowest `size` bits are set, each choice equally likely.
// count <= size <= 32.
uint32_t DrawBits(int size, int count, std::mt19937_64& random) {
  // Selection sampling (Knuth, volume 2, algorithm S): a bit is taken with the probability wanted /
  // left.
  uint32_t bits = 0;
  for (int left = size; left > 0; --left) {
    if (DrawIndex(static_cast<size_t>(left), random) >= static_cast<size_t>(count)) continue;
    bits |= 1u << (left - 1);
    --count;
  }
  return bits;
}

// Returns 1 / mean area of the masks with a scale over each mask cell; 0 for cells without one.
std::vector<float> PatchWeights(const MaskSet& masks, std::span<const float> mask_scales) {
  // 1 / A(p) of METHOD.md section 3 ("Contrastive loss"): w_pq is the product of those of p and q,
  // scaled in the batch.
  std::vector<float> weights;
  for (int cell = 0; cell < masks.num_cells(); ++cell) {
    double area = 0;
    int count = 0;
    ForEachMaskIn(CellBits(masks, cell), [&](int mask) {
      if (mask_scales[mask] <= kNoScale) return;
      area += static_cast<double>(masks.mask_area[mask]);
      ++count;
    });
    weights.push_back(count == 0 ? 0.0f : static_cast<float>(count / area));
  }
  return weights;
}

// Returns how many of a view's masks, the finest ones, give scales at a step: see
// FeatureOptions::fine_first. The share grows linearly from kFirstShare to 1.
size_t NumMasksAt(int step, const FeatureOptions& options, size_t num_masks) {
  constexpr double kFirstShare = 0.3;
  const double end = options.fine_first * options.num_steps;
  if (step >= end) return num_masks;
  const double share = std::lerp(kFirstShare, 1.0, step / end);
  return static_cast<size_t>(std::ceil(share * static_cast<double>(num_masks)));
}

DrawableView MakeDrawableView(const Capture& capture, int number, const MaskSet& masks,
                              const std::vector<float>& mask_scales) {
  const View& view = capture.views[number];
  DrawableView drawable = {number, &masks, mask_scales, mask_scales, {}, {}, {}, {}, {}};
  std::erase_if(drawable.sorted_scales, [](float scale) { return scale <= kNoScale; });
  std::sort(drawable.sorted_scales.begin(), drawable.sorted_scales.end());
  drawable.cell_weight = PatchWeights(masks, mask_scales);
  // In reading order: PixelsByMask needs ascending pixels, and draws index this list.
  for (size_t pixel = 0; pixel < masks.pixel_cell.size(); ++pixel) {
    if (drawable.cell_weight[masks.pixel_cell[pixel]] <= 0) continue;
    if (!view.ignore.empty() && view.ignore[pixel] != 0) continue;
    drawable.pixels.push_back(static_cast<int32_t>(pixel));
  }
  drawable.pixels_by_mask = PixelsByMask(masks, mask_scales, drawable.pixels);
  return drawable;
}

}  // namespace

std::vector<const MaskSet*> OwnMasks(const Capture& capture) {
  std::vector<const MaskSet*> masks;
  for (const View& view : capture.views) masks.push_back(&view.masks);
  return masks;
}

std::vector<DrawableView> MakeDrawableViews(const Capture& capture,
                                            std::span<const MaskSet* const> masks,
                                            std::span<const std::vector<float>> mask_scales) {
  std::vector<DrawableView> views(capture.views.size());
  ThreadPool pool(0);
  pool.ParallelFor(static_cast<int64_t>(views.size()), [&](int64_t i, int) {
    if (IsTrained(capture.views[i])) {
      views[i] = MakeDrawableView(capture, static_cast<int>(i), *masks[i], mask_scales[i]);
    }
  });
  std::erase_if(views, [](const DrawableView& view) { return view.pixels.empty(); });
  return views;
}

BatchDrawer::BatchDrawer(const FeatureField& field, const std::vector<DrawableView>& views,
                         const FeatureOptions& options)
    : field_(field),
      views_(views),
      options_(options),
      random_(options.seed),
      subset_steps_(std::max<size_t>(1, views.size())) {
  const auto most = static_cast<size_t>(options.views_per_chunk);
  if (most == 0 || views.size() <= most) return;
  num_subsets_ = static_cast<int>((views.size() + most - 1) / most);
  subset_steps_ = SubsetSize() * std::max<size_t>(1, options.steps_per_chunk / SubsetSize());
}

// All subsets have the same number of steps, which says where in views_left_ one ends. Where the
// views do not divide evenly, the last places of some subsets take up the first views again.
void BatchDrawer::BeginRound() {
  std::vector<int> subsets(num_subsets_);
  std::iota(subsets.begin(), subsets.end(), 0);
  // A single subset needs no order, and draws no number for it.
  for (size_t left = subsets.size(); left > 1; --left) {
    std::swap(subsets[DrawIndex(left, random_)], subsets[left - 1]);
  }
  for (const int subset : subsets) {
    for (size_t step = 0; step < subset_steps_; ++step) {
      const size_t view = subset + (step % SubsetSize()) * num_subsets_;
      views_left_.push_back(static_cast<int>(view % views_.size()));
    }
  }
}

BatchDrawer::Draft BatchDrawer::Next() {
  if (views_left_.empty()) BeginRound();
  // One draw of a Fisher-Yates shuffle a step instead of a whole shuffle a round: views_left_ and
  // the engine are all that a checkpoint must hold.
  const size_t left = NumLeftOfSubset();
  const size_t drawn = views_left_.size() - left + DrawIndex(left, random_);
  std::swap(views_left_[drawn], views_left_.back());
  const int next = views_left_.back();
  views_left_.pop_back();
  return {next, random_(), step_++};
}

int BatchDrawer::NumAlike() const {
  const int smoothed = NumSmoothedSteps(options_);
  const int alike = step_ < smoothed ? smoothed - step_ : std::numeric_limits<int>::max();
  if (num_subsets_ == 1) return alike;
  const size_t of_subset = views_left_.empty() ? subset_steps_ : NumLeftOfSubset();
  return std::min(alike, static_cast<int>(of_subset));
}

PixelBatch BatchDrawer::Draw(const Draft& draft) const {
  const DrawableView& view = views_[draft.view];
  // The order of the draws below decides every batch of a seed: a reordered call changes all
  // results and what a resumed training continues with.
  Random random(draft.seed);
  PixelBatch batch;
  batch.view = view.view;
  batch.scene_scales = DrawScales(view, draft.step, random);
  const std::vector<uint32_t> cells = DrawPixels(view, batch, random);
  DrawBackground(view, batch, random);
  batch.num_labelled = static_cast<int>(batch.pixels.size());
  DrawUnlabelled(view, batch, random);
  Label(view, cells, batch);
  for (const float scale : batch.scene_scales) {
    batch.scales.push_back(static_cast<float>(QuantileOfScale(field_, scale)));
  }
  batch.pair_seed = static_cast<uint32_t>(random() >> 32);
  batch.drawn_neighbors =
      draft.step < NumSmoothedSteps(options_)
          ? DrawBits(options_.num_neighbors, options_.num_drawn_neighbors, random)
          : kItselfOnly;
  return batch;
}

// All but two scales come from random masks: each is drawn between the scale of the next smaller
// mask and the mask's own, so that every interval between two masks gets its share. Of the other
// two, one is above the second largest mask, where at most the largest mask still separates pixels,
// and one below the smallest mask. While fine masks go first, no scale is above the largest mask
// that takes part.
std::vector<float> BatchDrawer::DrawScales(const DrawableView& view, int step,
                                           Random& random) const {
  const size_t num_masks = NumMasksAt(step, options_, view.sorted_scales.size());
  const std::span<const float> sorted(view.sorted_scales.data(), num_masks);
  const bool all = num_masks == view.sorted_scales.size();
  std::vector<float> scales;
  for (int k = 0; k + 2 < options_.num_scales; ++k) {
    const size_t mask = DrawIndex(sorted.size(), random);
    scales.push_back(DrawBetween(mask == 0 ? 0 : sorted[mask - 1], sorted[mask], random));
  }
  if (options_.num_scales >= 2) {
    const float second = sorted.size() < 2 ? 0 : sorted[sorted.size() - 2];
    // scale_quantiles.back() is the largest scale of all views, or its 99th percentile with
    // ScaleMapping::kEven.
    const float largest = all ? 2 * field_.scale_quantiles.back() : sorted.back();
    scales.push_back(DrawBetween(second, largest, random));
  }
  scales.push_back(DrawBetween(0, sorted.front(), random));
  return scales;
}

std::vector<uint32_t> BatchDrawer::DrawPixels(const DrawableView& view, PixelBatch& batch,
                                              Random& random) const {
  const MaskSet& masks = *view.masks;
  // Labels depend on the mask cell alone, so they are made once per cell and not per pixel.
  std::unordered_map<uint32_t, int32_t> number;  // mask cell of the view -> of the batch
  std::vector<uint32_t> cells;
  const long num_by_mask = std::lround(options_.mask_share * options_.num_pixels);
  for (int i = 0; i < options_.num_pixels; ++i) {
    const int32_t pixel = view.pixels[i < num_by_mask ? view.pixels_by_mask.Draw(random)
                                                      : DrawIndex(view.pixels.size(), random)];
    const uint32_t cell = masks.pixel_cell[pixel];
    const auto [at, is_new] = number.emplace(cell, static_cast<int32_t>(cells.size()));
    if (is_new) cells.push_back(cell);
    batch.pixels.push_back(pixel);
    batch.cell.push_back(at->second);
    batch.weight.push_back(view.cell_weight[cell]);
  }
  batch.num_cells = static_cast<int>(cells.size());
  return cells;
}

// Adds the background as one more mask cell, which the view does not have. It counts as a mask of
// its own that is as large as the image.
void BatchDrawer::DrawBackground(const DrawableView& view, PixelBatch& batch,
                                 Random& random) const {
  if (view.background.empty() || options_.num_background_pixels == 0) return;
  const MaskSet& masks = *view.masks;
  const float weight = 1 / (static_cast<float>(masks.width) * static_cast<float>(masks.height));
  for (int i = 0; i < options_.num_background_pixels; ++i) {
    batch.pixels.push_back(view.background[DrawIndex(view.background.size(), random)]);
    batch.cell.push_back(batch.num_cells);
    batch.weight.push_back(weight);
  }
  ++batch.num_cells;
}

void BatchDrawer::DrawUnlabelled(const DrawableView& view, PixelBatch& batch,
                                 Random& random) const {
  if (view.unlabelled.empty()) return;
  for (int i = 0; i < options_.num_perception_pixels; ++i) {
    batch.pixels.push_back(view.unlabelled[DrawIndex(view.unlabelled.size(), random)]);
  }
}

void BatchDrawer::Label(const DrawableView& view, std::span<const uint32_t> cells,
                        PixelBatch& batch) const {
  const MaskSet& masks = *view.masks;
  const auto words = static_cast<size_t>(masks.words);
  const bool has_background = static_cast<size_t>(batch.num_cells) > cells.size();
  // The bit of the background follows the masks' bits, which may take one word more.
  const size_t all_words = has_background ? static_cast<size_t>(masks.num_masks) / 64 + 1 : words;
  batch.label_words = static_cast<int>(all_words);
  batch.labels.resize(batch.scene_scales.size() * batch.num_cells * all_words);
  std::span<uint64_t> out = batch.labels;
  for (const float scale : batch.scene_scales) {
    for (const uint32_t cell : cells) {
      ScaleLabels(CellBits(masks, cell), view.mask_scales, scale, out.first(words));
      out = out.subspan(all_words);
    }
    if (!has_background) continue;
    out[masks.num_masks / 64] = uint64_t{1} << (masks.num_masks % 64);
    out = out.subspan(all_words);
  }
}

DrawerState BatchDrawer::Save() const {
  return {StateOf(random_), {views_left_.begin(), views_left_.end()}};
}

absl::Status BatchDrawer::Restore(const DrawerState& state, int step) {
  // Next() indexes views_ with these numbers unchecked.
  for (const int32_t view : state.views_left) {
    if (view >= 0 && view < static_cast<int32_t>(views_.size())) continue;
    return absl::DataLossError(
        absl::StrCat("views_left has view ", view, ", must be in [0, ", views_.size(), ")"));
  }
  step_ = step;
  views_left_.assign(state.views_left.begin(), state.views_left.end());
  return SetState(state.random, random_);
}

}  // namespace pepeseg
