#include "kernels/math/sift.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>
#include <vector>

#include "kernels/cpu/cpu_backend.h"
#include "kernels/sift_scales.h"

// SIFT on the CPU (kernels/ops/sift.h). Blurs, differences and windows are in simd/sift.cc. Tasks
// are bands of scanlines, and points; each writes results of its own, which are joined in their
// order. Octaves from 0 on come first; octave -1, three quarters of the work, is built only if they
// have too few points.

namespace pepeseg {
namespace {

constexpr int kBandRows = 32;      // scanlines of a task
constexpr int kPointsAtOnce = 16;  // points of a task
constexpr int kMargin = 32;        // floats around a line
constexpr int kDogs = kSiftLevels - 1;

auto OrderOf(const SiftFound& point) {
  return std::tuple(point.keypoint.y, point.keypoint.x, point.keypoint.scale);
}

struct Feature {
  const SiftFound* point;
  float angle;
};

// One call of the op.
class SiftExtraction {
 public:
  SiftExtraction(const ExtractSiftArgs& args, ThreadPool& pool, const SimdKernels& simd)
      : args_(args),
        pool_(pool),
        simd_(simd),
        octaves_(SiftOctaves(args.width, args.height)),
        lines_(pool.num_threads()) {
    // Room for a blurred line, or for three scanlines of each difference.
    const int64_t line = octaves_.empty() ? 0 : RowFloats(octaves_.front());
    for (std::vector<float>& lines : lines_) lines.resize(line * 3 * kDogs);
  }

  // Finds the points and keeps those of the largest scales, in their order. Returns false when out
  // of memory.
  bool FindPoints(Backend& backend);
  // Finds the directions of the points.
  std::vector<Feature> Directions();
  void Describe(std::span<const Feature> features, uint8_t* descriptors);

 private:
  static int64_t RowFloats(const SiftOctave& octave) { return octave.stride + 2 * kMargin; }
  void Build(int octave);
  void LoadPhotograph(const SiftOctave& octave, int level);
  void Upsample(const SiftOctave& octave, int level);
  void Halve(const SiftOctave& from, const SiftOctave& to);
  void Blur(const SiftOctave& octave, int from, int to, const SiftTaps& taps);
  void Search(int octave);
  void SearchBand(int octave, int first, int thread, std::vector<SiftFound>* found);
  void Refine(int octave, int x, int y, int level, std::vector<SiftFound>* found);
  bool IsIgnored(const SiftKeypoint& keypoint) const;
  SiftWindow WindowOf(const SiftFound& point);

  const ExtractSiftArgs& args_;
  ThreadPool& pool_;
  const SimdKernels& simd_;
  std::vector<SiftOctave> octaves_;        // the finest first
  std::vector<std::vector<float>> lines_;  // by thread: working memory
  std::vector<SiftFound> points_;
};

// Writes the photograph to a level of octave 0, white as 1.
void SiftExtraction::LoadPhotograph(const SiftOctave& octave, int level) {
  pool_.ParallelFor(octave.height, [&](int64_t y, int) {
    const uint8_t* grey = args_.grey.data + y * octave.width;
    float* out = octave.Row(level, y);
    for (int x = 0; x < octave.width; ++x) out[x] = static_cast<float>(grey[x]) / 255;
  });
}

// Writes the photograph to a level of octave -1, with the means of neighbours between its pixels.
// Beyond the border the last pixel is repeated.
void SiftExtraction::Upsample(const SiftOctave& octave, int level) {
  const int width = args_.width, height = args_.height;
  pool_.ParallelFor(height, [&](int64_t y, int) {
    const uint8_t* here = args_.grey.data + y * width;
    const uint8_t* below = y + 1 < height ? here + width : here;
    float *even = octave.Row(level, 2 * y), *odd = even + octave.stride;
    for (int x = 0; x < width; ++x) {
      const int next = x + 1 < width ? x + 1 : x;
      const int a = here[x], b = here[next], c = below[x], d = below[next];
      even[2 * x] = static_cast<float>(a) / 255;
      even[2 * x + 1] = static_cast<float>(a + b) / (2 * 255);
      odd[2 * x] = static_cast<float>(a + c) / (2 * 255);
      odd[2 * x + 1] = static_cast<float>(a + b + c + d) / (4 * 255);
    }
  });
}

// Writes level 0 of an octave: every second pixel of the level of twice its blur of the finer one.
void SiftExtraction::Halve(const SiftOctave& from, const SiftOctave& to) {
  pool_.ParallelFor(to.height, [&](int64_t y, int) {
    const float* in = from.Row(kSiftStep, 2 * y);
    float* out = to.Row(0, y);
    for (int x = 0; x < to.width; ++x) out[x] = in[2 * x];
  });
}

void SiftExtraction::Blur(const SiftOctave& octave, int from, int to, const SiftTaps& taps) {
  const int height = octave.height, num_bands = (height + kBandRows - 1) / kBandRows;
  pool_.ParallelFor(num_bands, [&](int64_t band, int thread) {
    const float* rows[2 * kMaxSiftRadius + 1];
    const int first = static_cast<int>(band) * kBandRows;
    for (int y = first; y < std::min(height, first + kBandRows); ++y) {
      for (int k = -taps.radius; k <= taps.radius; ++k) {
        rows[k + taps.radius] = octave.Row(from, std::clamp(y + k, 0, height - 1));
      }
      simd_.blur_sift_row({.rows = rows,
                           .taps = taps.tap,
                           .radius = taps.radius,
                           .width = octave.width,
                           .line = lines_[thread].data() + kMargin,
                           .out = octave.Row(to, y)});
    }
  });
}

// Fills the levels of an octave. The last one holds what the first is made from.
void SiftExtraction::Build(int index) {
  const SiftOctave& octave = octaves_[index];
  constexpr int kLast = kSiftLevels - 1;
  if (index == 0) {
    Upsample(octave, kLast);
    Blur(octave, kLast, 0, SiftFinestTaps());
  } else if (index == 1) {
    LoadPhotograph(octave, kLast);
    Blur(octave, kLast, 0, SiftPhotographTaps());
  } else {
    Halve(octaves_[index - 1], octave);
  }
  for (int level = 1; level < kSiftLevels; ++level) {
    Blur(octave, level - 1, level, SiftLevelTaps(level));
  }
}

// Adds the points of an octave, in the order of their scanlines.
void SiftExtraction::Search(int octave) {
  const int num_bands = (octaves_[octave].height + kBandRows - 1) / kBandRows;
  std::vector<std::vector<SiftFound>> found(num_bands);
  pool_.ParallelFor(num_bands, [&](int64_t band, int thread) {
    SearchBand(octave, static_cast<int>(band) * kBandRows, thread, &found[band]);
  });
  for (const auto& band : found) points_.insert(points_.end(), band.begin(), band.end());
}

// Keeps the last three scanlines of each difference. Those of scanline y are at y % 3.
void SiftExtraction::SearchBand(int index, int first, int thread, std::vector<SiftFound>* found) {
  const SiftOctave& octave = octaves_[index];
  const auto dog_row = [&](int dog, int y) {
    return lines_[thread].data() + (dog * 3 + y % 3) * RowFloats(octave) + kMargin;
  };
  std::vector<int32_t> columns(octave.width / 2 + 1);
  const int from = std::max(first - 1, 0), end = std::min(first + kBandRows, octave.height - 1);
  for (int y = from; y <= end; ++y) {
    const float* levels[kSiftLevels];
    float* out[kDogs];
    for (int k = 0; k < kSiftLevels; ++k) levels[k] = octave.Row(k, y);
    for (int k = 0; k < kDogs; ++k) out[k] = dog_row(k, y);
    simd_.sift_differences(levels, octave.width, out);
    if (y < from + 2) continue;
    for (int level = 1; level <= kSiftStep; ++level) {
      SiftExtremaRow row = {{}, octave.width, 0.8f * kSiftContrast};
      for (int k = 0; k < 9; ++k) row.dog[k / 3][k % 3] = dog_row(level + k / 3 - 1, y + k % 3 - 2);
      const int count = simd_.sift_extrema(row, columns.data());
      for (int k = 0; k < count; ++k) Refine(index, columns[k], y - 1, level, found);
    }
  }
}

// Adds the point of an extremum unless it is refused.
void SiftExtraction::Refine(int index, int x, int y, int level, std::vector<SiftFound>* found) {
  const SiftOctave& octave = octaves_[index];
  const auto dog = [&](int px, int py, int at) {
    return octave.Row(at + 1, py)[px] - octave.Row(at, py)[px];
  };
  SiftFound point = {{}, index, {}};
  if (!RefineExtremum(dog, octave.width, octave.height, x, y, level, &point.in_octave)) return;
  point.keypoint = ToPhotograph(point.in_octave, octave.step);
  if (!IsIgnored(point.keypoint)) found->push_back(point);
}

bool SiftExtraction::IsIgnored(const SiftKeypoint& keypoint) const {
  if (args_.ignore.empty()) return false;
  const int x = std::clamp(static_cast<int>(keypoint.x), 0, args_.width - 1);
  const int y = std::clamp(static_cast<int>(keypoint.y), 0, args_.height - 1);
  return args_.ignore[int64_t{y} * args_.width + x] != 0;
}

bool SiftExtraction::FindPoints(Backend& backend) {
  if (octaves_.empty()) return true;
  const int num_octaves = static_cast<int>(octaves_.size());
  const std::span<SiftOctave> all(octaves_), octave_minus_1 = all.first(1),
                                             coarser = all.subspan(1);
  if (!args_.scratch->levels.Reserve(backend, SiftLevelFloats(coarser))) return false;
  PlaceSiftOctaves(args_.scratch->levels.span().data, coarser);
  for (int octave = 1; octave < num_octaves; ++octave) {
    Build(octave);
    Search(octave);
  }
  if (static_cast<int64_t>(points_.size()) <= args_.max_features) {
    if (!args_.scratch->finest.Reserve(backend, SiftLevelFloats(octave_minus_1))) return false;
    PlaceSiftOctaves(args_.scratch->finest.span().data, octave_minus_1);
    Build(0);
    Search(0);
  }
  std::vector<int64_t> count(num_octaves * kSiftStep);
  for (const SiftFound& point : points_) ++count[point.scale()];
  const int finest = FirstSiftScale(count, args_.max_features);
  std::erase_if(points_, [&](const SiftFound& point) { return point.scale() < finest; });
  std::stable_sort(points_.begin(), points_.end(),
                   [](const SiftFound& a, const SiftFound& b) { return OrderOf(a) < OrderOf(b); });
  const auto same = [](const SiftFound& a, const SiftFound& b) { return OrderOf(a) == OrderOf(b); };
  points_.erase(std::unique(points_.begin(), points_.end(), same), points_.end());
  return true;
}

SiftWindow SiftExtraction::WindowOf(const SiftFound& point) {
  const SiftOctave& octave = octaves_[point.octave];
  const SiftPoint& at = point.in_octave;
  return {
      octave.Row(at.level, 0), octave.stride, octave.width, octave.height, at.x, at.y, at.sigma};
}

std::vector<Feature> SiftExtraction::Directions() {
  struct Angles {
    int count;
    float angle[kMaxOrientations];
  };
  const auto num_points = static_cast<int64_t>(points_.size());
  std::vector<Angles> angles(num_points);
  pool_.ParallelFor((num_points + kPointsAtOnce - 1) / kPointsAtOnce, [&](int64_t task, int) {
    for (int64_t i = task * kPointsAtOnce; i < std::min(num_points, (task + 1) * kPointsAtOnce);
         ++i) {
      float histogram[kOrientationBins];
      simd_.sift_directions(WindowOf(points_[i]), histogram);
      angles[i].count = OrientationPeaks(histogram, angles[i].angle);
    }
  });
  std::vector<Feature> features;
  for (int64_t i = 0; i < num_points; ++i) {
    for (int k = 0; k < angles[i].count; ++k) features.push_back({&points_[i], angles[i].angle[k]});
  }
  return features;
}

void SiftExtraction::Describe(std::span<const Feature> features, uint8_t* descriptors) {
  const auto count = static_cast<int64_t>(features.size());
  pool_.ParallelFor((count + kPointsAtOnce - 1) / kPointsAtOnce, [&](int64_t task, int) {
    for (int64_t i = task * kPointsAtOnce; i < std::min(count, (task + 1) * kPointsAtOnce); ++i) {
      const float angle = features[i].angle;
      simd_.sift_descriptor(WindowOf(*features[i].point), {angle, std::cos(angle), std::sin(angle)},
                            descriptors + i * kSiftDescriptorSize);
    }
  });
}

}  // namespace

void CpuBackend::ExtractSift(const ExtractSiftArgs& args) {
  if (failed()) return;
  SiftExtraction extraction(args, pool_, simd_);
  if (!extraction.FindPoints(*this)) return;
  const std::vector<Feature> features = extraction.Directions();
  const auto count = static_cast<int64_t>(features.size());
  if (!args.keypoints->Reserve(*this, count) ||
      !args.descriptors->Reserve(*this, count * kSiftDescriptorSize)) {
    return;
  }
  for (int64_t i = 0; i < count; ++i) {
    args.keypoints->span()[i] = features[i].point->keypoint;
    args.keypoints->span()[i].angle = features[i].angle;
  }
  extraction.Describe(features, args.descriptors->span().data);
}

}  // namespace pepeseg
