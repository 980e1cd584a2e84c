#include "core/features/centroid_term.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "core/base/random_state.h"
#include "core/base/status_macros.h"
#include "core/features/mask_scales.h"
#include "core/features/random_draws.h"
#include "core/scene/model.h"
#include "kernels/ops/render.h"

namespace pepeseg {
namespace {

constexpr float kMovedShare = 0.1f;  // of the way from a centroid to the mean of its cluster

double Dot(const float* a, const float* b) {
  double sum = 0;
  for (int k = 0; k < kFeatureSize; ++k) sum += double{a[k]} * b[k];
  return sum;
}

// Counts the pixels of each cluster that have a label, and those whose label has a given mask.
class Votes {
 public:
  Votes(int num_clusters, int num_masks)
      : num_masks_(num_masks),
        labelled_(num_clusters),
        held_(static_cast<size_t>(num_clusters) * num_masks) {}

  // labels: of one pixel of the cluster, see ScaleLabels.
  void Add(int cluster, std::span<const uint64_t> labels) {
    bool any = false;
    ForEachMaskIn(labels, [&](int mask) {
      ++held_[static_cast<size_t>(cluster) * num_masks_ + mask];
      any = true;
    });
    if (any) ++labelled_[cluster];
  }

  // Returns whether one mask holds enough of the cluster's labelled pixels.
  bool Agree(int cluster) const {
    // A cluster without a labelled pixel agrees: 0 >= 0.
    const auto first = held_.begin() + static_cast<int64_t>(cluster) * num_masks_;
    const int most = *std::max_element(first, first + num_masks_);
    return most >= kMinAgreement * labelled_[cluster];
  }

 private:
  int num_masks_;
  std::vector<int> labelled_;  // [clusters] pixels
  std::vector<int> held_;      // [clusters, masks] pixels
};

// Keeps these random numbers apart from the drawer's.
constexpr uint64_t kCentroidStream = 0xd1b54a32d192ed03u;

}  // namespace

Clusters KeepAgreeing(const Clusters& clusters, const MaskSet& masks,
                      std::span<const int32_t> pixels, std::span<const float> mask_scales,
                      float scale) {
  if (clusters.count == 0 || masks.empty()) return clusters;
  Votes votes(clusters.count, masks.num_masks);
  std::vector<uint64_t> labels(masks.words);
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (clusters.labels[i] == kNoise) continue;
    const uint32_t cell = masks.pixel_cell[pixels[i]];
    ScaleLabels(CellBits(masks, cell), mask_scales, scale, labels);
    votes.Add(clusters.labels[i], labels);
  }
  Clusters kept = clusters;
  kept.count = 0;
  std::vector<int> number(clusters.count, kNoise);  // after dropped clusters are gone
  for (int c = 0; c < clusters.count; ++c) {
    if (votes.Agree(c)) number[c] = kept.count++;
  }
  for (int& label : kept.labels) label = label == kNoise ? kNoise : number[label];
  return kept;
}

void CentroidBank::Merge(std::span<const float> means) {
  // New centroids of this call are not compared with its other means. Means have length 1, so that
  // Dot is the cosine.
  const size_t num_known = centroids_.size();  // floats; the centroids before this call
  for (size_t i = 0; i < means.size(); i += kFeatureSize) {
    const float* mean = means.data() + i;
    if (Dot(mean, mean) == 0) continue;
    double best = double{merge_cosine_};
    float* nearest = nullptr;
    for (size_t k = 0; k < num_known; k += kFeatureSize) {
      const double cosine = Dot(mean, centroids_.data() + k);
      if (cosine <= best) continue;
      best = cosine;
      nearest = centroids_.data() + k;
    }
    if (nearest == nullptr) {
      centroids_.insert(centroids_.end(), mean, mean + kFeatureSize);
      continue;
    }
    for (int k = 0; k < kFeatureSize; ++k) nearest[k] += kMovedShare * (mean[k] - nearest[k]);
    // Back to length 1, which the next comparisons and the loss rely on.
    const auto inv_length = static_cast<float>(1 / std::sqrt(Dot(nearest, nearest)));
    for (int k = 0; k < kFeatureSize; ++k) nearest[k] *= inv_length;
  }
}

CentroidTerm::CentroidTerm(Backend& backend, const Capture& capture, Renderer& scene,
                           const std::vector<DrawableView>& views, const FeatureOptions& options)
    : backend_(backend),
      capture_(capture),
      scene_(scene),
      views_(views),
      first_step_(static_cast<int>(std::lround(options.centroid_from * options.num_steps))),
      every_(options.centroid_every),
      max_pixels_(options.centroid_pixels),
      num_views_(options.centroid_views),
      masked_only_(options.centroid_masked_only),
      check_masks_(options.centroid_check_masks),
      random_(options.seed ^ kCentroidStream) {
  // HDBSCAN options are {min_cluster_size, min_samples}, chosen for pixels of one view.
  if (options.centroid_weight_upper > 0) {
    levels_.push_back({true,
                       1.0f,
                       options.centroid_weight_upper,
                       options.centroid_cosine_upper,
                       {20, 5},
                       CentroidBank(options.centroid_merge_upper),
                       {}});
  }
  if (options.centroid_weight_lower > 0) {
    levels_.push_back({false,
                       0.01f,
                       options.centroid_weight_lower,
                       options.centroid_cosine_lower,
                       {10, 5},
                       CentroidBank(options.centroid_merge_lower),
                       {}});
  }
  sums_ = Buffer<double>(
      backend, static_cast<int64_t>(kMaxUnreadFeatureSteps * levels_.size()) * kNumCentroidSums);
}

bool CentroidTerm::Due(int step) const {
  // first_step_ is a share of the planned steps: the caller counts skipped steps as done.
  return !levels_.empty() && step >= first_step_ && (step - first_step_) % every_ == 0;
}

bool CentroidTerm::active() const {
  return std::any_of(levels_.begin(), levels_.end(),
                     [](const Level& level) { return !level.centroids.empty(); });
}

// Selection sampling (Knuth, volume 2, algorithm S): each pixel is taken with the probability
// wanted / left.
std::vector<int32_t> CentroidTerm::DrawPixels(const DrawableView& view) {
  const Camera& camera = capture_.views[view.view].camera;
  auto left = masked_only_ ? static_cast<int64_t>(view.pixels.size())
                           : int64_t{camera.width} * camera.height;
  int64_t wanted = std::min<int64_t>(left, max_pixels_);
  std::vector<int32_t> pixels;
  for (int32_t i = 0; left > 0; ++i) {
    if (static_cast<int64_t>(DrawIndex(static_cast<size_t>(left--), random_)) >= wanted) continue;
    pixels.push_back(masked_only_ ? view.pixels[i] : i);
    --wanted;
  }
  return pixels;
}

// The blend rows of the chunk are of other pixels, so the view is rasterised again.
std::vector<float> CentroidTerm::PixelFeatures(const View& view, std::span<const int32_t> pixels,
                                               DeviceSpan<const float> features) {
  const CapturedRows rows = scene_.Rows(view, pixels);
  Buffer<float> of_pixels(backend_, static_cast<int64_t>(pixels.size()) * kFeatureSize);
  backend_.FeatureRows(
      {{rows.first.span(), rows.gaussian.span(), rows.weight.span()}, features, of_pixels.span()});
  std::vector<float> out(static_cast<size_t>(of_pixels.size()));
  of_pixels.Download(std::span<float>(out));
  return out;
}

absl::Status CentroidTerm::Refresh(DeviceSpan<const float> features, std::span<const float> gate) {
  // METHOD.md section 3, "Centroids": the clusters of random views update the bank of each scale.
  // The draws come from an engine of their own, which a checkpoint holds.
  for (int i = 0; i < num_views_; ++i) {
    RETURN_IF_ERROR(MergeView(views_[DrawIndex(views_.size(), random_)], features, gate));
  }
  for (Level& level : levels_) UploadBank(level);
  return absl::OkStatus();
}

absl::Status CentroidTerm::MergeView(const DrawableView& view, DeviceSpan<const float> features,
                                     std::span<const float> gate) {
  const std::vector<int32_t> pixels = DrawPixels(view);
  const std::vector<float> of_pixels = PixelFeatures(capture_.views[view.view], pixels, features);
  if (const std::string error = backend_.error(); !error.empty()) {
    return absl::ResourceExhaustedError(absl::StrCat("features: centroids: ", error));
  }
  for (Level& level : levels_) {
    const std::vector<float> units = GatedUnits(of_pixels, gate, level.scale);
    ASSIGN_OR_RETURN(const Clusters found,
                     Hdbscan(backend_, std::span<const float>(units), level.hdbscan));
    // The label of a pixel has all its masks at the upper scale, the finest alone at the lower.
    const float label_scale = level.upper ? std::numeric_limits<float>::infinity() : 0.0f;
    const Clusters clusters =
        check_masks_ ? KeepAgreeing(found, *view.masks, pixels, view.mask_scales, label_scale)
                     : found;
    level.bank.Merge(ClusterMeans(units, clusters));
  }
  return absl::OkStatus();
}

void CentroidTerm::UploadBank(Level& level) {
  const std::vector<float>& centroids = level.bank.centroids();
  level.centroids.Reserve(backend_, static_cast<int64_t>(centroids.size()));
  level.centroids.Upload(std::span<const float>(centroids));
}

CentroidState CentroidTerm::Save() const {
  CentroidState state = {StateOf(random_), {}, {}};
  for (const Level& level : levels_) {
    (level.upper ? state.upper : state.lower) = level.bank.centroids();
  }
  return state;
}

absl::Status CentroidTerm::Restore(const CentroidState& state) {
  for (Level& level : levels_) {
    level.bank.Set(level.upper ? state.upper : state.lower);
    UploadBank(level);
  }
  return SetState(state.random, random_);
}

// Only the labelled pixels, which come first, count.
void CentroidTerm::AddGradients(const RowChunk::Step& step, const Spans& spans, int unread_step) {
  const int64_t num_labelled = int64_t{step.batch->num_labelled} * kFeatureSize;
  for (size_t i = 0; i < levels_.size(); ++i) {
    if (levels_[i].centroids.empty()) continue;
    // A slot for each step and scale, so that the host need not wait after each step.
    const auto at = static_cast<int64_t>(unread_step * levels_.size() + i) * kNumCentroidSums;
    backend_.CentroidLoss({.pixel_features = spans.pixel_features.Subspan(0, num_labelled),
                           .centroids = levels_[i].centroids.span(),
                           .gate = spans.gate,
                           .scale = levels_[i].scale,
                           .min_cosine = levels_[i].min_cosine,
                           .weight = levels_[i].weight,
                           .pixel_grad = spans.pixel_grad.Subspan(0, num_labelled),
                           .gate_grad = spans.gate_grad,
                           .sums = sums_.span().Subspan(at, kNumCentroidSums)});
  }
}

std::vector<double> CentroidTerm::ReadLosses(int num_steps) {
  std::vector<double> losses(static_cast<size_t>(num_steps));
  if (!active()) return losses;
  std::vector<double> sums(losses.size() * levels_.size() * kNumCentroidSums);
  sums_.Download(std::span<double>(sums));
  // The slots are [steps, levels]. A step before the first centroids has left its slot at 0.
  for (size_t i = 0; i < losses.size() * levels_.size(); ++i) {
    const Level& level = levels_[i % levels_.size()];
    // Mean of 1 - C over the pixels near a centroid, times the weight of the level.
    const double* of_step = sums.data() + i * kNumCentroidSums;
    if (level.centroids.empty() || of_step[kNumNearCentroids] == 0) continue;
    losses[i / levels_.size()] +=
        double{level.weight} * of_step[kCentroidLoss] / of_step[kNumNearCentroids];
  }
  return losses;
}

}  // namespace pepeseg
