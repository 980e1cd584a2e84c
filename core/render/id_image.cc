#include "core/render/id_image.h"

#include <algorithm>
#include <numeric>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kBandPixels = 524'288;  // about 200 MB: 50 entries a pixel of 8 bytes each
constexpr float kMinAlpha = 0.5f;         // smallest sum of weights of a pixel that shows a segment

// Sums of weights by id for one pixel. A pixel shows few ids, so that a list is searched.
class Votes {
 public:
  void Clear() { sums_.clear(); }
  void Add(int32_t id, float weight) {
    const auto found =
        std::find_if(sums_.begin(), sums_.end(), [id](const Sum& sum) { return sum.id == id; });
    found == sums_.end() ? sums_.push_back({id, weight}) : void(found->weight += weight);
  }
  // Returns the id with the largest sum; 0, which stands for no segment, takes part like any id.
  int32_t Winner() const {
    Sum best;
    float total = 0;
    for (const Sum& sum : sums_) {
      total += sum.weight;
      // Ties go to the smaller id, so that the image does not depend on the order of the entries.
      if (sum.weight > best.weight || (sum.weight == best.weight && sum.id < best.id)) best = sum;
    }
    return total < kMinAlpha ? 0 : best.id;
  }

 private:
  struct Sum {
    int32_t id = 0;
    float weight = 0;
  };
  std::vector<Sum> sums_;
};

}  // namespace

absl::StatusOr<std::vector<int32_t>> RenderIds(const ModelView& view, std::span<const int32_t> ids,
                                               RowsOfPixels rows) {
  const int64_t num_pixels = int64_t{view.camera.width} * view.camera.height;
  std::vector<int32_t> image(static_cast<size_t>(num_pixels));
  Votes votes;
  // Bands bound the memory of the blend rows, not that of the image.
  for (int64_t first = 0; first < num_pixels; first += kBandPixels) {
    std::vector<int32_t> pixels(static_cast<size_t>(std::min(kBandPixels, num_pixels - first)));
    std::iota(pixels.begin(), pixels.end(), static_cast<int32_t>(first));
    ASSIGN_OR_RETURN(const PixelRows band, rows(view, pixels));
    for (size_t i = 0; i < pixels.size(); ++i) {
      votes.Clear();
      for (int32_t e = band.first[i]; e < band.first[i + 1]; ++e) {
        votes.Add(ids[band.gaussian[e]], band.weight[e]);
      }
      image[pixels[i]] = votes.Winner();
    }
  }
  return image;
}

}  // namespace pepeseg
