#include "core/find/word_votes.h"

#include <algorithm>
#include <functional>
#include <numeric>

namespace pepeseg {
namespace {

constexpr size_t kFewestViews = 2;

double Overlap(double first, double last, double other_first, double other_last) {
  return std::max(0.0, std::min(last, other_last) - std::max(first, other_first));
}

// Returns the IoU of a box and the box around what the view shows of a segment.
double BoxFit(const Sighting& sighting, const SeenArea& area, const SeenView& view) {
  const double x0 = sighting.x0 * view.width, x1 = sighting.x1 * view.width;
  const double y0 = sighting.y0 * view.height, y1 = sighting.y1 * view.height;
  const double last_x = area.x1 + 1.0, last_y = area.y1 + 1.0;
  const double both = Overlap(x0, x1, area.x0, last_x) * Overlap(y0, y1, area.y0, last_y);
  const double all = (x1 - x0) * (y1 - y0) + (last_x - area.x0) * (last_y - area.y0) - both;
  return all > 0 ? both / all : 0;
}

// Returns the IoUs of a mask and the pixels of each segment on the view's grid.
std::vector<double> MaskFits(const Sighting& sighting, const SeenView& view) {
  std::vector<int32_t> shared(view.areas.size());
  int64_t pixels = 0;
  for (int y = 0; y < view.height; ++y) {
    const int64_t from_y = int64_t{2 * y + 1} * sighting.mask_height / (2 * view.height);
    for (int x = 0; x < view.width; ++x) {
      const int64_t from_x = int64_t{2 * x + 1} * sighting.mask_width / (2 * view.width);
      if (sighting.mask.pixels[from_y * sighting.mask_width + from_x] == 0) continue;
      ++pixels;
      for (const std::vector<int32_t>& level : view.shown) {
        const int32_t segment = level[size_t{1} * y * view.width + x];
        if (segment >= 0) ++shared[segment];
      }
    }
  }
  std::vector<double> fits(shared.size());
  for (size_t s = 0; s < fits.size(); ++s) {
    if (shared[s] == 0) continue;
    fits[s] = static_cast<double>(shared[s]) /
              static_cast<double>(pixels + view.areas[s].pixels - shared[s]);
  }
  return fits;
}

// The sightings of a view, with the IoUs of their masks and the segments.
struct Sighted {
  const SeenView& view;
  std::span<const Sighting> sightings;
  std::span<const uint8_t> is_piece;           // [segments]
  std::vector<std::vector<double>> mask_fits;  // [sightings]; empty for a box

  double FitOf(size_t sighting, size_t segment) const {
    const std::vector<double>& fits = mask_fits[sighting];
    if (!fits.empty()) return fits[segment];
    // The halves of a thing may have boxes that are nearly its own.
    return is_piece[segment] != 0 ? 0 : BoxFit(sightings[sighting], view.areas[segment], view);
  }
};

std::vector<Sighted> SightedViews(const SceneSegments& scene,
                                  std::span<const std::vector<Sighting>> sightings,
                                  std::span<const uint8_t> is_piece) {
  std::vector<Sighted> all;
  for (size_t v = 0; v < scene.views.size(); ++v) {
    Sighted& sighted = all.emplace_back(Sighted{scene.views[v], sightings[v], is_piece, {}});
    for (const Sighting& one : sightings[v]) {
      sighted.mask_fits.push_back(one.mask.pixels.empty() ? std::vector<double>()
                                                          : MaskFits(one, scene.views[v]));
    }
  }
  return all;
}

// Returns the mean of the better half of `num_views` values, of which those that are missing are 0.
double BetterHalf(std::vector<double> values, size_t num_views) {
  const size_t half = std::max(kFewestViews, (num_views + 1) / 2);
  std::sort(values.begin(), values.end(), std::greater<>());
  values.resize(std::min(values.size(), half));
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(half);
}

SegmentWord WordOf(std::span<const Sighted> views, size_t segment, int num_words) {
  std::vector<std::vector<double>> by_word(num_words);  // scores of views that see the word
  std::vector<double> best(num_words);
  size_t num_views = 0;
  for (const Sighted& sighted : views) {
    if (sighted.view.areas[segment].pixels < kSightedPixels) continue;
    ++num_views;
    std::fill(best.begin(), best.end(), 0);
    for (size_t i = 0; i < sighted.sightings.size(); ++i) {
      const double fit = sighted.FitOf(i, segment);
      if (fit < kSightingFits) continue;
      double& score = best[sighted.sightings[i].word];
      score = std::max(score, sighted.sightings[i].score * fit);
    }
    for (int word = 0; word < num_words; ++word) {
      if (best[word] > 0) by_word[word].push_back(best[word]);
    }
  }
  SegmentWord found = {static_cast<int32_t>(segment), 0, 0};
  for (int word = 0; word < num_words; ++word) {
    const double score = BetterHalf(std::move(by_word[word]), num_views);
    if (score > found.score) found = {found.segment, word, score};
  }
  return found;
}

bool LiesIn(const SceneSegments& scene, int32_t inner, int32_t outer) {
  while (inner >= 0 && inner < outer) inner = scene.segments[inner].parent;
  return inner == outer;
}

}  // namespace

std::vector<SegmentWord> VoteWords(const SceneSegments& scene,
                                   std::span<const std::vector<Sighting>> sightings,
                                   int num_words) {
  std::vector<uint8_t> is_piece;
  for (const SceneSegments::Segment& segment : scene.segments) {
    is_piece.push_back(segment.is_piece ? 1 : 0);
  }
  const std::vector<Sighted> views = SightedViews(scene, sightings, is_piece);
  std::vector<SegmentWord> words;
  for (size_t segment = 0; segment < scene.segments.size(); ++segment) {
    const SegmentWord found = WordOf(views, segment, num_words);
    if (found.score > 0) words.push_back(found);
  }
  std::sort(words.begin(), words.end(), [&](const SegmentWord& a, const SegmentWord& b) {
    if (a.score != b.score) return a.score > b.score;
    const int64_t size_a = scene.segments[a.segment].num_gaussians;
    const int64_t size_b = scene.segments[b.segment].num_gaussians;
    return size_a != size_b ? size_a > size_b : a.segment < b.segment;
  });
  return words;
}

std::vector<SegmentWord> ThingsOfWord(const SceneSegments& scene,
                                      std::span<const SegmentWord> words, int word) {
  std::vector<SegmentWord> things;
  for (const SegmentWord& one : words) {
    if (one.word != word) continue;
    const bool nested = std::any_of(things.begin(), things.end(), [&](const SegmentWord& thing) {
      return LiesIn(scene, one.segment, thing.segment) || LiesIn(scene, thing.segment, one.segment);
    });
    if (!nested) things.push_back(one);
  }
  return things;
}

}  // namespace pepeseg
