#include "core/features/perception_cues.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "core/features/gradient_statistics.h"
#include "core/features/mask_scales.h"

namespace pepeseg {
namespace {

// r(s) by the image (ours: the paper gives no formula) is min(kMaxRadius, kRadiusBase +
// kRadiusSlope * s) of its shorter side; by the masks it is kRadiusOfMasks of their mean side. The
// smaller one counts.
constexpr float kRadiusBase = 0.03f, kRadiusSlope = 0.12f, kMaxRadius = 0.2f;
constexpr float kRadiusOfMasks = 0.5f;
constexpr float kMinRadius = 2;  // pixels
// Bounds of r(s) without perception_fit_window, pixels.
constexpr float kWideMinRadius = 20, kWideMaxRadius = 200;
// A pixel is paired with this many of the nearest pixels around it, and with as many of the others.
constexpr size_t kNearest = 8;
// A threshold is measured on a spiral of samples around the pixel, denser towards the pixel.
// Smaller scales use the first samples only, at least kMinSamples.
constexpr int kNumSamples = 64, kMinSamples = 8;

// Columns and rows from the pixel to each sample.
using Spiral = std::array<std::array<int, 2>, kNumSamples>;
// Returns the samples from the centre outwards: steps of the golden angle, radii that grow evenly
// up to `radius`.
Spiral SpiralOf(float radius) {
  // pi (3 - sqrt 5): no two samples lie in the same direction, whatever their number.
  constexpr double kGoldenAngle = 2.399963229728653;
  const auto scaled = [radius](double share) {
    return static_cast<int>(std::lround(radius * static_cast<float>(share)));
  };
  Spiral spiral;
  for (int i = 0; i < kNumSamples; ++i) {
    const double share = (i + 0.5) / kNumSamples, angle = kGoldenAngle * i;
    spiral[i] = {scaled(share * std::cos(angle)), scaled(share * std::sin(angle))};
  }
  return spiral;
}

// Returns the Euclidean distance of two colours in RGB; 1: one channel from black to white.
float ColorDifference(const Image& photo, int64_t a, int64_t b) {
  int squares = 0;
  for (int c = 0; c < 3; ++c) {
    const int difference = int{photo.pixels[3 * a + c]} - int{photo.pixels[3 * b + c]};
    squares += difference * difference;
  }
  return std::sqrt(static_cast<float>(squares)) / 255;
}

// A pixel of a batch, in the order of the scanlines.
struct Place {
  float y, x;
  int32_t number;  // index into PixelBatch::pixels

  friend bool operator<(const Place& a, const Place& b) {
    return std::tie(a.y, a.number) < std::tie(b.y, b.number);
  }
};
// Returns the pixels away from edges, sorted.
std::vector<Place> PlacesByRow(std::span<const int32_t> pixels, std::span<const uint8_t> edges,
                               int width) {
  std::vector<Place> places;
  places.reserve(pixels.size());
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (edges[pixels[i]] != 0) continue;
    const int32_t y = pixels[i] / width, x = pixels[i] % width;
    places.push_back({static_cast<float>(y), static_cast<float>(x), static_cast<int32_t>(i)});
  }
  std::sort(places.begin(), places.end());
  return places;
}

}  // namespace

PerceptionCues::PerceptionCues(const Capture& capture, const CrossView& cross_view,
                               const std::vector<DrawableView>& views,
                               std::vector<std::vector<uint8_t>> edges,
                               const FeatureOptions& options)
    : capture_(capture),
      cross_view_(cross_view),
      edges_(std::move(edges)),
      mask_sides_(capture.views.size()),
      threshold_(options.perception_threshold),
      depth_floor_(options.perception_depth_floor),
      color_floor_(options.perception_color_floor),
      fit_window_(options.perception_fit_window),
      unlabelled_only_(options.perception_unlabelled_only),
      ask_other_views_(options.perception_cross_view) {
  for (const DrawableView& drawn : views) {
    std::vector<std::pair<float, float>>& sides = mask_sides_[drawn.view];
    const std::vector<int64_t>& areas = drawn.masks->mask_area;
    for (size_t mask = 0; mask < areas.size(); ++mask) {
      if (drawn.mask_scales[mask] <= kNoScale) continue;
      sides.emplace_back(drawn.mask_scales[mask], std::sqrt(static_cast<float>(areas[mask])));
    }
    std::sort(sides.begin(), sides.end());
  }
}

// The radius by the image, but at most half the mean side of the view's masks that are not larger
// than the scale, so that it does not reach over whole objects. If all masks are larger, the finest
// one counts. Without perception_fit_window only the scale and the image count.
std::vector<float> PerceptionCues::Radii(const PixelBatch& batch) const {
  const Camera& camera = capture_.views[batch.view].camera;
  const auto side = static_cast<float>(std::min(camera.width, camera.height));
  std::vector<float> radii;
  if (!fit_window_) {
    for (const float scale : batch.scales) {
      radii.push_back(
          std::clamp(side * (kRadiusBase + kRadiusSlope * scale), kWideMinRadius, kWideMaxRadius));
    }
    return radii;
  }
  for (size_t k = 0; k < batch.scales.size(); ++k) {
    float sum = 0;
    int count = 0;
    for (const auto& [scale, mask_side] : mask_sides_[batch.view]) {
      if (count > 0 && scale > batch.scene_scales[k]) break;
      sum += mask_side;
      ++count;
    }
    const float of_image =
        side * std::min(kMaxRadius, kRadiusBase + kRadiusSlope * batch.scales[k]);
    radii.push_back(
        std::max(kMinRadius, std::min(of_image, kRadiusOfMasks * sum / static_cast<float>(count))));
  }
  return radii;
}

// The nearest pixels of all are paired, and a regular selection of the others by distance. A pixel
// can only be near pixels in a band of scanlines, which a binary search finds.
std::vector<PerceptionCues::Pair> PerceptionCues::NearPairs(const PixelBatch& batch,
                                                            float radius) const {
  const std::vector<Place> places =
      PlacesByRow(batch.pixels, edges_[batch.view], capture_.views[batch.view].camera.width);
  std::vector<Pair> pairs;
  std::vector<std::pair<float, int32_t>> about;
  for (const Place& place : places) {
    if (unlabelled_only_ && place.number < batch.num_labelled) continue;
    about.clear();
    for (auto at = std::lower_bound(places.begin(), places.end(), Place{place.y - radius, 0, 0});
         at != places.end() && at->y <= place.y + radius; ++at) {
      const float x = at->x - place.x, y = at->y - place.y, squared = x * x + y * y;
      if (squared > 0 && squared <= radius * radius) about.emplace_back(squared, at->number);
    }
    std::sort(about.begin(), about.end());
    const size_t nearest = std::min(kNearest, about.size()), others = about.size() - nearest;
    const size_t stride = std::max<size_t>(1, (others + kNearest - 1) / kNearest);
    for (size_t i = 0; i < about.size(); i += i < nearest ? 1 : stride) {
      // A pair is listed once: under its unlabelled pixel, or under the first of two alike.
      const int32_t q = about[i].second;
      const bool labelled = place.number < batch.num_labelled;
      const bool alike = labelled == (q < batch.num_labelled);
      if (alike ? place.number < q : !labelled) pairs.push_back({place.number, q, 0});
    }
  }
  return pairs;
}

// Keeps the thresholds and sights of pixels, because most pixels are in several pairs.
class PerceptionCues::Judge {
 public:
  Judge(const PerceptionCues& cues, const PixelBatch& batch, std::span<const float> radii)
      : cues_(cues),
        view_(cues.capture_.views[batch.view]),
        batch_(batch),
        radii_(radii),
        max_radius_(*std::ranges::max_element(radii)),
        spiral_(SpiralOf(max_radius_)),
        usual_(batch.pixels.size()),
        sight_(batch.pixels.size()) {}

  // Fills in the thresholds of PerceptionThreshold::kWindows for the pixels of the pairs.
  void MeasureWindows(std::span<const Pair> pairs) {
    const int width = view_.camera.width, height = view_.camera.height;
    WindowSums depth(width, height, [&](int64_t i) {
      return GradientAt(i, width, height, [&](int64_t a, int64_t b) {
        return view_.depth.values[a] - view_.depth.values[b];
      });
    });
    WindowSums color(width, height, [&](int64_t i) {
      return GradientAt(i, width, height,
                        [&](int64_t a, int64_t b) { return ColorDifference(view_.photo, a, b); });
    });
    for (const Pair& pair : pairs) {
      for (const int32_t p : {pair.p, pair.q}) {
        if (usual_[p]) continue;
        Usual& usual = usual_[p].emplace();
        for (size_t k = 0; k < radii_.size(); ++k) {
          const int radius = static_cast<int>(std::lround(radii_[k]));
          const int32_t pixel = batch_.pixels[p];
          usual.depth[k] = std::max(cues_.depth_floor_, depth.OneAboveMean(pixel, radius));
          usual.color[k] = std::max(cues_.color_floor_, color.OneAboveMean(pixel, radius));
        }
      }
    }
  }

  PairCues CuesOf(int32_t p, int32_t q) {
    const int32_t a = batch_.pixels[p], b = batch_.pixels[q];
    const int width = view_.camera.width;
    const int32_t x = a % width - b % width, y = a / width - b / width;
    const float distance = std::hypot(static_cast<float>(x), static_cast<float>(y));
    const float depth = std::abs(view_.depth.values[a] - view_.depth.values[b]);
    const float color = ColorDifference(view_.photo, a, b);
    const Usual &of_p = UsualAbout(p), &of_q = UsualAbout(q);
    uint32_t similar = 0, dissimilar = 0;
    for (size_t k = 0; k < radii_.size(); ++k) {
      // The pair is listed for the largest radius: at a scale with a smaller one it has no cue.
      if (distance > radii_[k]) continue;
      const bool deep = depth >= std::max(of_p.depth[k], of_q.depth[k]);
      const bool colorful = color >= std::max(of_p.color[k], of_q.color[k]);
      similar |= static_cast<uint32_t>(!deep && !colorful) << k;
      dissimilar |= static_cast<uint32_t>(deep && colorful) << k;
    }
    if (std::max(p, q) < batch_.num_labelled) {
      // METHOD.md section 7: of covered pixels only the cues that the masks agree with count.
      const uint32_t same = SameLabel(p, q);
      similar &= same;
      dissimilar &= ~same;
    }
    if (cues_.ask_other_views_ && (similar | dissimilar) != 0) {
      const CrossView::Verdict verdict =
          cues_.cross_view_.Judge(batch_.view, SightOf(p), SightOf(q), batch_.scene_scales);
      // METHOD.md section 3, "Perception loss": the masks of near views overrule the cue.
      similar &= ~verdict.apart;
      dissimilar &= ~verdict.together;
    }
    return similar | dissimilar << kDissimilarShift;
  }

 private:
  // Returns a bit for each scale: 1 if the labels of two labelled pixels intersect.
  uint32_t SameLabel(int32_t p, int32_t q) const {
    const auto words = static_cast<size_t>(batch_.label_words);
    uint32_t same = 0;
    for (size_t k = 0; k < radii_.size(); ++k) {
      const uint64_t* at = batch_.labels.data() + k * batch_.num_cells * words;
      const uint64_t *of_p = at + batch_.cell[p] * words, *of_q = at + batch_.cell[q] * words;
      uint64_t common = 0;
      for (size_t word = 0; word < words; ++word) common |= of_p[word] & of_q[word];
      same |= static_cast<uint32_t>(common != 0) << k;
    }
    return same;
  }
  const Usual& UsualAbout(int32_t p) {
    if (!usual_[p]) usual_[p] = MeasureAbout(batch_.pixels[p]);
    return *usual_[p];
  }
  // Returns the thresholds of a pixel, y * width + x. With kDifferences the samples are compared
  // with the pixel itself. With kGradients each sample is compared with its neighbour on the right
  // or below, by turns.
  Usual MeasureAbout(int32_t pixel) const {
    const int width = view_.camera.width, height = view_.camera.height;
    const int pixel_x = pixel % width, pixel_y = pixel / width;
    const bool gradients = cues_.threshold_ == PerceptionThreshold::kGradients;
    std::array<Spread, kNumSamples + 1> depth, color;  // [i]: of the first i samples
    for (int i = 0; i < kNumSamples; ++i) {
      // Running statistics: one pass serves all radii, because a smaller radius uses a prefix of
      // the samples.
      depth[i + 1] = depth[i];
      color[i + 1] = color[i];
      const int x = pixel_x + spiral_[i][0], y = pixel_y + spiral_[i][1];
      // The last column and scanline are left out for both kinds: kGradients reads one pixel
      // further.
      if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height) continue;
      const int64_t at = int64_t{y} * width + x;
      const int64_t neighbor = gradients ? at + (i % 2 == 0 ? 1 : width) : pixel;
      const float difference = std::abs(view_.depth.values[at] - view_.depth.values[neighbor]);
      if (!std::isnan(difference)) depth[i + 1].Add(difference);
      color[i + 1].Add(ColorDifference(view_.photo, at, neighbor));
    }
    Usual usual = {};
    for (size_t k = 0; k < radii_.size(); ++k) {
      const int count = std::clamp(static_cast<int>(kNumSamples * radii_[k] / max_radius_),
                                   kMinSamples, kNumSamples);
      usual.depth[k] = std::max(cues_.depth_floor_, depth[count].OneAboveMean());
      usual.color[k] = std::max(cues_.color_floor_, color[count].OneAboveMean());
    }
    return usual;
  }
  const CrossView::Sight& SightOf(int32_t p) {
    if (!sight_[p]) sight_[p] = cues_.cross_view_.Look(batch_.view, batch_.pixels[p]);
    return *sight_[p];
  }

  const PerceptionCues& cues_;
  const View& view_;
  const PixelBatch& batch_;
  std::span<const float> radii_;
  const float max_radius_;
  const Spiral spiral_;
  std::vector<std::optional<Usual>> usual_;
  std::vector<std::optional<CrossView::Sight>> sight_;
};

void PerceptionCues::List(PixelBatch& batch) const {
  if (static_cast<size_t>(batch.num_labelled) == batch.pixels.size()) return;
  const std::vector<float> radii = Radii(batch);
  std::vector<Pair> pairs = NearPairs(batch, *std::max_element(radii.begin(), radii.end()));
  Judge judge(*this, batch, radii);
  if (threshold_ == PerceptionThreshold::kWindows && !pairs.empty()) judge.MeasureWindows(pairs);
  for (Pair& pair : pairs) pair.cues = judge.CuesOf(pair.p, pair.q);
  std::erase_if(pairs, [](const Pair& pair) { return pair.cues == 0; });
  batch.pairs = ListsOf(pairs, batch.pixels.size(), batch.scales.size());
}

PairLists PerceptionCues::ListsOf(std::span<const Pair> pairs, size_t num_pixels,
                                  size_t num_scales) {
  // Lists in the manner of a sparse matrix: the partners of pixel i lie in [first[i], first[i +
  // 1]). Each pair is listed from both ends, so that each pixel sums its own gradient.
  PairLists lists;
  lists.first.assign(num_pixels + 1, 0);
  for (const Pair& pair : pairs) {
    ++lists.first[pair.p + 1];
    ++lists.first[pair.q + 1];
  }
  for (size_t i = 1; i < lists.first.size(); ++i) lists.first[i] += lists.first[i - 1];
  lists.other.resize(2 * pairs.size());
  lists.cues.resize(2 * pairs.size());
  std::vector<int32_t> next(lists.first.begin(), lists.first.end() - 1);
  for (const Pair& pair : pairs) {
    for (const auto& [from, to] : {std::pair(pair.p, pair.q), std::pair(pair.q, pair.p)}) {
      lists.other[next[from]] = to;
      lists.cues[next[from]++] = pair.cues;
    }
  }
  lists.share.assign(2 * num_scales, 0);
  for (size_t i = 0; i < lists.share.size(); ++i) {
    // share: 1 / (pairs at this scale * scales), for similar pairs at each scale, then for
    // dissimilar ones. It makes the loss a mean over pairs, then over scales.
    const size_t bit = i < num_scales ? i : kDissimilarShift + i - num_scales;
    const auto count = std::count_if(
        pairs.begin(), pairs.end(), [&](const Pair& pair) { return (pair.cues >> bit & 1u) != 0; });
    if (count > 0) lists.share[i] = 1 / static_cast<float>(static_cast<size_t>(count) * num_scales);
  }
  return lists;
}

}  // namespace pepeseg
