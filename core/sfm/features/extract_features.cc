#include "core/sfm/features/extract_features.h"

#include <algorithm>
#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/device_lock.h"
#include "core/base/num_threads.h"
#include "core/base/status_macros.h"
#include "core/formats/decode_luma.h"
#include "core/formats/images.h"

namespace pepeseg {
namespace {

constexpr int kMostDecoding = 16;  // threads

// A photograph as the op takes it.
struct DecodedPhotograph {
  Image grey;                   // shrunk
  std::vector<uint8_t> ignore;  // of the pixels of `grey`; may be empty
  int width = 0, height = 0;    // stored
};

// Returns the ignored pixels of a photograph at another size: those of the nearest pixels.
std::vector<uint8_t> ResizedTo(const std::vector<uint8_t>& ignored, const DecodedPhotograph& of) {
  const int width = of.grey.width, height = of.grey.height;
  if (width == of.width && height == of.height) return ignored;
  std::vector<uint8_t> resized;
  resized.reserve(static_cast<size_t>(width) * height);
  for (int64_t y = 0; y < height; ++y) {
    const int64_t from_y = (2 * y + 1) * of.height / (2 * height);
    for (int64_t x = 0; x < width; ++x) {
      resized.push_back(ignored[from_y * of.width + (2 * x + 1) * of.width / (2 * width)]);
    }
  }
  return resized;
}

absl::StatusOr<DecodedPhotograph> Decode(const FeaturePhotograph& photograph, int max_side) {
  ASSIGN_OR_RETURN(Image image, DecodeLuma(photograph.path, photograph.name));
  DecodedPhotograph decoded;
  decoded.width = image.width;
  decoded.height = image.height;
  decoded.grey = ShrunkTo(std::move(image), max_side);
  if (!photograph.ignored) return decoded;
  ASSIGN_OR_RETURN(const std::vector<uint8_t> ignored, photograph.ignored());
  if (ignored.empty()) return decoded;
  if (ignored.size() != static_cast<size_t>(decoded.width) * decoded.height) {
    return absl::InvalidArgumentError(absl::StrCat("\"", photograph.name, "\": ", ignored.size(),
                                                   " ignored pixels for ", decoded.width, "x",
                                                   decoded.height));
  }
  decoded.ignore = ResizedTo(ignored, decoded);
  return decoded;
}

// Decodes photographs on threads, at most `num_threads` + 1 ahead of the one that is taken next.
class DecodingQueue {
 public:
  DecodingQueue(std::span<const FeaturePhotograph> photographs, int max_side, int num_threads)
      : photographs_(photographs), max_side_(max_side), ahead_(num_threads + 1) {
    for (int i = 0; i < num_threads; ++i) threads_.emplace_back([this] { Work(); });
  }
  ~DecodingQueue() {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  // Blocks until the next photograph, in their order, is decoded.
  absl::StatusOr<DecodedPhotograph> Take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return decoded_.contains(taken_); });
    auto photograph = std::move(decoded_.extract(taken_).mapped());
    ++taken_;
    changed_.notify_all();
    return photograph;
  }

 private:
  void Work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] {
        return stopping_ || next_ >= photographs_.size() || next_ < taken_ + ahead_;
      });
      if (stopping_ || next_ >= photographs_.size()) return;
      const size_t index = next_++;
      lock.unlock();
      auto photograph = Decode(photographs_[index], max_side_);
      lock.lock();
      decoded_.emplace(index, std::move(photograph));
      changed_.notify_all();
    }
  }

  std::span<const FeaturePhotograph> photographs_;
  const int max_side_;
  const size_t ahead_;
  std::mutex mutex_;  // guards what follows, except the threads
  std::condition_variable changed_;
  size_t next_ = 0, taken_ = 0;  // indices of the next photograph to decode, and to take
  std::map<size_t, absl::StatusOr<DecodedPhotograph>> decoded_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

// Runs the op on one photograph after another, in the same memory.
class FeatureExtractor {
 public:
  FeatureExtractor(Backend& backend, int max_features)
      : backend_(backend), max_features_(max_features) {}

  SfmFeatures Extract(const DecodedPhotograph& photograph) {
    grey_.Reserve(backend_, static_cast<int64_t>(photograph.grey.pixels.size()));
    grey_.Upload(photograph.grey.pixels);
    ignore_.Reserve(backend_, static_cast<int64_t>(photograph.ignore.size()));
    ignore_.Upload(photograph.ignore);
    SfmFeatures features;
    if (grey_.empty() || ignore_.size() != static_cast<int64_t>(photograph.ignore.size())) {
      return features;  // out of memory, which the backend reports
    }
    backend_.ExtractSift({.grey = grey_.span(),
                          .width = photograph.grey.width,
                          .height = photograph.grey.height,
                          .ignore = ignore_.span(),
                          .max_features = max_features_,
                          .scratch = &scratch_,
                          .keypoints = &keypoints_,
                          .descriptors = &descriptors_});
    std::vector<SiftKeypoint> keypoints(keypoints_.size());
    keypoints_.Download(keypoints);
    features.descriptors.resize(descriptors_.size());
    descriptors_.Download(features.descriptors);
    const float scale_x = static_cast<float>(photograph.width) / photograph.grey.width;
    const float scale_y = static_cast<float>(photograph.height) / photograph.grey.height;
    for (const SiftKeypoint& k : keypoints) {
      features.keypoints.push_back(
          {k.x * scale_x, k.y * scale_y, k.scale * (scale_x + scale_y) / 2, k.angle});
    }
    return features;
  }

 private:
  Backend& backend_;
  int max_features_;
  SiftScratch scratch_;
  Buffer<uint8_t> grey_, ignore_, descriptors_;
  Buffer<SiftKeypoint> keypoints_;
};

}  // namespace

int NumDecoding(int num_threads) { return std::min(NumThreads(num_threads), kMostDecoding); }

absl::Status ExtractFeatures(Backend& backend, std::span<const FeaturePhotograph> photographs,
                             const SfmFeatureOptions& options, TakeFeaturesFn take) {
  if (photographs.empty()) return absl::OkStatus();
  DecodingQueue queue(photographs, options.max_side, NumDecoding(options.num_threads));
  FeatureExtractor extractor(backend, options.max_features);
  for (size_t i = 0; i < photographs.size(); ++i) {
    ASSIGN_OR_RETURN(const DecodedPhotograph decoded, queue.Take());
    ASSIGN_OR_RETURN(SfmFeatures features,
                     WithDeviceLock(backend, [&]() -> absl::StatusOr<SfmFeatures> {
                       return extractor.Extract(decoded);
                     }));
    RETURN_IF_ERROR(take(i, std::move(features)));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
