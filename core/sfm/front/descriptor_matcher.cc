#include "core/sfm/front/descriptor_matcher.h"

#include <algorithm>
#include <mutex>
#include <numeric>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

// The defaults of COLMAP 3.8.
constexpr float kMaxRatio = 0.8f, kMaxAngle = 0.7f;
constexpr float kScoreRatio = 0.9f;
constexpr size_t kNumLargest = 256;
// Products of features in a quarter of a second, on one core without VNNI and on a GPU.
constexpr double kCpuProducts = 7e7, kDeviceProducts = 2e11;
constexpr size_t kMostPairs = 4096;  // in one call: bounds its memory

// Returns the indices of the largest features, the larger first.
std::vector<size_t> LargestOf(const SfmFeatures& features) {
  std::vector<size_t> order(features.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return features.keypoints[a].scale > features.keypoints[b].scale;
  });
  order.resize(std::min(order.size(), kNumLargest));
  return order;
}

}  // namespace

absl::StatusOr<DescriptorMatcher> DescriptorMatcher::Create(
    Backend& backend, const std::vector<const SfmFeatures*>& features) {
  DescriptorMatcher matcher(backend, features);
  RETURN_IF_ERROR(matcher.Upload());
  return matcher;
}

absl::Status DescriptorMatcher::Upload() {
  std::vector<uint8_t> all;
  const auto end_block = [&] {
    block_first_.push_back(static_cast<int64_t>(all.size()) / kDescriptorBytes);
  };
  end_block();
  for (const SfmFeatures* features : features_) {
    all.insert(all.end(), features->descriptors.begin(), features->descriptors.end());
    end_block();
  }
  for (const SfmFeatures* features : features_) {
    for (const size_t i : LargestOf(*features)) {
      const auto from = features->descriptors.begin() + static_cast<int64_t>(i) * kDescriptorBytes;
      all.insert(all.end(), from, from + kDescriptorBytes);
    }
    end_block();
  }
  const std::lock_guard lock(backend_->exclusive_use());
  descriptors_ = Buffer<uint8_t>(*backend_, std::span<const uint8_t>(all));
  const auto upload = [&](float ratio) {
    const std::vector<int32_t> limits = SecondDotLimits(ratio, kMaxAngle);
    return Buffer<int32_t>(*backend_, std::span<const int32_t>(limits));
  };
  match_limits_ = upload(kMaxRatio);
  score_limits_ = upload(kScoreRatio);
  return Run({}, match_limits_, true);
}

// Runs the op, if there are pairs, and returns the backend's error. The lock must be held.
absl::Status DescriptorMatcher::Run(std::span<const BlockPair> pairs, const Buffer<int32_t>& limits,
                                    bool mutual) {
  if (!pairs.empty()) {
    backend_->MatchDescriptors({.descriptors = std::as_const(descriptors_).span(),
                                .block_first = block_first_,
                                .pairs = pairs,
                                .second_limits = limits.span(),
                                .mutual = mutual,
                                .pair_first = &pair_first_,
                                .matches = &matches_});
  }
  const BackendError error = backend_->TakeError();
  if (error.what.empty()) return absl::OkStatus();
  const std::string text = absl::StrCat("matching features: ", error.what);
  return error.fatal ? absl::InternalError(text) : absl::ResourceExhaustedError(text);
}

absl::StatusOr<std::vector<std::vector<FeatureMatch>>> DescriptorMatcher::Match(
    std::span<const PhotographPair> pairs) {
  std::vector<BlockPair> blocks;
  for (const PhotographPair& pair : pairs) {
    blocks.push_back({static_cast<int32_t>(pair.first), static_cast<int32_t>(pair.second)});
  }
  const std::lock_guard lock(backend_->exclusive_use());
  RETURN_IF_ERROR(Run(blocks, match_limits_, /*mutual=*/true));
  std::vector<std::vector<FeatureMatch>> of_pair(pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    for (int64_t k = pair_first_[i]; k < pair_first_[i + 1]; ++k) {
      of_pair[i].push_back({matches_[k].first, matches_[k].second});
    }
  }
  return of_pair;
}

absl::StatusOr<std::vector<int64_t>> DescriptorMatcher::Score(
    std::span<const PhotographPair> pairs) {
  const auto n = static_cast<int32_t>(features_.size());
  std::vector<BlockPair> blocks;
  // By direction, because the CPU keeps what it has prepared of the second block.
  for (const PhotographPair& pair : pairs) {
    blocks.push_back({n + static_cast<int32_t>(pair.first), static_cast<int32_t>(pair.second)});
  }
  for (const PhotographPair& pair : pairs) {
    blocks.push_back({n + static_cast<int32_t>(pair.second), static_cast<int32_t>(pair.first)});
  }
  const std::lock_guard lock(backend_->exclusive_use());
  RETURN_IF_ERROR(Run(blocks, score_limits_, /*mutual=*/false));
  std::vector<int64_t> scores(pairs.size());
  for (size_t i = 0; i < blocks.size(); ++i) {
    scores[i % pairs.size()] += pair_first_[i + 1] - pair_first_[i];
  }
  return scores;
}

size_t DescriptorMatcher::BatchOf(std::span<const PhotographPair> pairs, bool for_score) const {
  const double most = backend_->memory().is_host ? kCpuProducts : kDeviceProducts;
  double products = 0;
  size_t count = 0;
  while (count < std::min(pairs.size(), kMostPairs) && products < most) {
    const auto first = static_cast<double>(features_[pairs[count].first]->size());
    const auto second = static_cast<double>(features_[pairs[count].second]->size());
    products += for_score ? kNumLargest * (first + second) : first * second;
    ++count;
  }
  return count;
}

}  // namespace pepeseg
