#include "core/render/renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "core/render/image_of_planes.h"
#include "kernels/buffer.h"
#include "kernels/math/blend.h"

namespace pepeseg {
namespace {

constexpr double kNearPlane = 0.01;  // share of the scene radius, as in stage one
// Opacity logit of a hidden Gaussian. Its opacity of 2e-9 reaches 1 / 255 in no pixel, so that it
// is culled.
constexpr float kHiddenLogit = -20;
constexpr float kMinDepthAlpha = 0.5f;  // accumulated alpha up to which a pixel has no depth
constexpr float kMinIdAlpha = 0.5f;     // smallest sum of weights of a pixel that shows a segment
// Assumed number of Gaussians whose bounding squares cover a pixel. 87 reproduces the 279 entries
// for each pixel that tests/bench/results/step_cpu.md measured.
constexpr double kOverlap = 100;
constexpr int64_t kBandPixels = 524'288;  // about 200 MB: 50 entries per pixel of 8 bytes each

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
    return total < kMinIdAlpha ? 0 : best.id;
  }

 private:
  struct Sum {
    int32_t id = 0;
    float weight = 0;
  };
  std::vector<Sum> sums_;
};

int64_t NumPixels(const Viewpoint& view) { return int64_t{view.camera.width} * view.camera.height; }

}  // namespace

PixelRows ToHost(const CapturedRows& rows) {
  PixelRows host;
  host.first.resize(rows.first.size());
  host.gaussian.resize(rows.gaussian.size());
  host.weight.resize(rows.weight.size());
  rows.first.Download(std::span<int32_t>(host.first));
  rows.gaussian.Download(std::span<int32_t>(host.gaussian));
  rows.weight.Download(std::span<float>(host.weight));
  // A backend that ran out of memory may have listed the entries of no row.
  const size_t num_entries = host.first.empty() ? 0 : static_cast<size_t>(host.first.back());
  if (std::min(host.gaussian.size(), host.weight.size()) < num_entries) return {};
  return host;
}

std::vector<int32_t> IdsOfRows(const PixelRows& rows, std::span<const int32_t> ids) {
  std::vector<int32_t> shown(rows.num_rows());
  Votes votes;
  for (size_t i = 0; i < shown.size(); ++i) {
    votes.Clear();
    for (int32_t e = rows.first[i]; e < rows.first[i + 1]; ++e) {
      votes.Add(ids[rows.gaussian[e]], rows.weight[e]);
    }
    shown[i] = votes.Winner();
  }
  return shown;
}

int64_t MostPixels(int64_t max_view_pixels) {
  return std::max(max_view_pixels, int64_t{1920} * 1080);
}

// With P = num_pixels / num_gaussians, the bounding square of a Gaussian is sqrt(kOverlap P) pixels
// wide and touches 1 + width / kTileSize tiles a side on average.
ScratchSize TypicalScratch(int64_t num_gaussians, int64_t num_pixels) {
  const auto count = static_cast<double>(std::max<int64_t>(1, num_gaussians));
  const double width = std::sqrt(kOverlap * static_cast<double>(num_pixels) / count);
  const double tiles_a_side = 1 + width / kTileSize;
  ScratchSize size;
  size.num_gaussians = num_gaussians;
  // Tiles at two edges reach beyond the image.
  size.num_tiles = num_pixels / (kTileSize * kTileSize) * 5 / 4 + 64;
  // A Gaussian has at most one entry in each tile.
  size.num_entries = static_cast<int64_t>(
      count * std::min(tiles_a_side * tiles_a_side, static_cast<double>(size.num_tiles)));
  size.num_pixels = num_pixels;
  return size;
}

Renderer::Renderer(Backend& backend, const Gaussians& gaussians, double scene_radius)
    : backend_(backend),
      count_(gaussians.count),
      sh_degree_(gaussians.sh_degree),
      near_plane_(static_cast<float>(kNearPlane * scene_radius)),
      most_pixels_(MostPixels(0)),
      planes_(backend, std::span<const float>(gaussians.planes)),
      shown_planes_(planes_.span().data) {}

Renderer::Renderer(Backend& twin, const Renderer& other)
    : backend_(twin),
      count_(other.count_),
      sh_degree_(other.sh_degree_),
      near_plane_(other.near_plane_),
      most_pixels_(other.most_pixels_),
      shown_planes_(other.shown_planes_) {}

Renderer::Renderer(Backend& backend, const Model& model)
    : backend_(backend),
      count_(model.gaussians.count),
      sh_degree_(model.gaussians.sh_degree),
      near_plane_(static_cast<float>(kNearPlane * model.scene_radius)),
      most_pixels_(MostPixels(LargestView(model.views))),
      logits_(model.gaussians.Plane(kOpacityPlane)),
      planes_(backend, std::span<const float>(model.gaussians.planes)),
      shown_planes_(planes_.span().data),
      features_(backend, std::span<const float>(model.field.features)),
      confidence_(backend, std::span<const float>(model.field.confidence)) {}

void Renderer::ReleaseOversized() {
  // Buffers never shrink by themselves: one request for a large image would hold its memory for
  // good.
  if (scratch_.pixel_last_entry.capacity() <= WithReserve(most_pixels_)) return;
  for (Buffer<float>* buffer : {&color_, &alpha_, &depth_}) *buffer = {};
  scratch_ = {};
}

// Changes only the opacities, in place, which needs no second copy of the planes. One set of planes
// serves all requests of a model, so each render sets the opacities that it needs. It restores them
// before a render, not after one, because a backend that ran out of memory in a render copies
// nothing. After an error the opacities are not known and count as hidden.
void Renderer::Show(const GaussianSet* subset) {
  // The planes lie one after the other, so the opacities are one range.
  const int64_t first = kOpacityPlane * count_;
  if (subset != nullptr) {
    assert(!logits_.empty() && subset->member.size() == logits_.size());
    std::vector<float> shown(logits_.size());
    for (size_t i = 0; i < shown.size(); ++i) {
      shown[i] = subset->member[i] != 0 ? logits_[i] : kHiddenLogit;
    }
    planes_.Upload(shown, first);
  } else if (some_hidden_) {
    planes_.Upload(logits_, first);
  }
  some_hidden_ = !logits_.empty() && (subset != nullptr || !backend_.error().empty());
}

// Renders into color_, alpha_ and depth_, and leaves in scratch_ what features and rows need. An
// allocation that fails makes the backend skip the render.
void Renderer::Render(const Viewpoint& view, const Pass& pass) {
  const int64_t num_pixels = NumPixels(view);
  color_.Reserve(backend_, 3 * num_pixels);
  if (pass.with_depth) {
    alpha_.Reserve(backend_, num_pixels);
    depth_.Reserve(backend_, num_pixels);
  }
  Show(pass.subset);
  backend_.Render({.gaussians = {shown_planes_, count_, count_, sh_degree_},
                   .view = ToPinholeView(view.camera, view.cam_from_world),
                   .near_plane = near_plane_,
                   .active_sh_degree = pass.sh_degree,
                   .scratch = &scratch_,
                   .color = color_.span(),
                   .alpha = pass.with_depth ? alpha_.span() : DeviceSpan<float>(),
                   .depth = pass.with_depth ? depth_.span() : DeviceSpan<float>(),
                   .for_backward = pass.for_backward});
}

DeviceSpan<const float> Renderer::ColorPlanes(const Viewpoint& view, const GaussianSet* subset) {
  Render(view, {.sh_degree = sh_degree_, .subset = subset});
  return color_.span();
}

std::vector<float> Renderer::HostColorPlanes(const Viewpoint& view, const GaussianSet* subset) {
  ColorPlanes(view, subset);
  std::vector<float> planes(static_cast<size_t>(3 * NumPixels(view)));
  color_.Download(std::span<float>(planes));
  return planes;
}

Image Renderer::Color(const Viewpoint& view, const GaussianSet* subset) {
  return ImageOfPlanes(view.camera.width, view.camera.height, HostColorPlanes(view, subset));
}

// The backend blends z with the weights of colour; divided by alpha that is the mean depth.
void WeightedDepth::Normalise() {
  for (size_t i = 0; i < depth.size(); ++i) {
    depth[i] = alpha[i] > kMinDepthAlpha ? depth[i] / alpha[i] : 0;
  }
}

std::vector<float> Renderer::Depth(const Viewpoint& view, const GaussianSet* subset) {
  WeightedDepth depth;
  Depth(view, depth, subset);
  depth.Normalise();
  return std::move(depth.depth);
}

void Renderer::Depth(const Viewpoint& view, WeightedDepth& depth, const GaussianSet* subset) {
  Render(view, {.subset = subset, .with_depth = true});
  const auto num_pixels = static_cast<size_t>(NumPixels(view));
  depth.alpha.assign(num_pixels, 0);  // and so are the depths if the backend fails
  depth.depth.resize(num_pixels);
  alpha_.Download(std::span<float>(depth.alpha));
  depth_.Download(std::span<float>(depth.depth));
}

// One pass gives both. The colours of Rows and Ids, of degree 0, are not used.
void Renderer::Features(const Viewpoint& view, DeviceSpan<Half> map, DeviceSpan<float> color,
                        const GaussianSet* subset) {
  const bool wants_color = color.size > 0;
  Render(view, {.sh_degree = wants_color ? sh_degree_ : 0, .subset = subset});
  if (wants_color) backend_.Copy(color.data, color_.span().data, color.size * sizeof(float));
  backend_.RenderFeatures({features_.span(), &scratch_, map, confidence_.span()});
}

CapturedRows Renderer::Rows(const Viewpoint& view, std::span<const int32_t> pixels,
                            const GaussianSet* subset) {
  Render(view, {.subset = subset});
  return Capture(pixels);
}

void Renderer::RenderBackward(const Viewpoint& view, DeviceSpan<const float> color_grad) {
  Render(view, {.for_backward = true});
  backend_.RenderBackward({.view = ToPinholeView(view.camera, view.cam_from_world),
                           .color_grad = color_grad,
                           .scratch = &scratch_});
}

void Renderer::AddWeights(DeviceSpan<float> sums, int num_planes) {
  backend_.AddWeights({.scratch = &scratch_, .num_planes = num_planes, .sums = sums});
}

// Lists for each pixel the Gaussians and weights that the latest render blended.
CapturedRows Renderer::Capture(std::span<const int32_t> pixels) {
  CapturedRows rows;
  const Buffer<int32_t> pixel_buffer(backend_, pixels);
  rows.alpha = Buffer<float>(backend_, static_cast<int64_t>(pixels.size()));
  backend_.CaptureRows({.pixels = pixel_buffer.span(),
                        .scratch = &scratch_,
                        .row_first = &rows.first,
                        .entry_gaussian = &rows.gaussian,
                        .entry_weight = &rows.weight,
                        .pixel_alpha = rows.alpha.span(),
                        .pixel_depth = {}});
  return rows;
}

// Renders once, and lists the rows of a band of pixels at a time, which bounds their memory.
std::vector<int32_t> Renderer::Ids(const Viewpoint& view, std::span<const int32_t> ids,
                                   const GaussianSet* subset) {
  Render(view, {.subset = subset});
  const int64_t num_pixels = NumPixels(view);
  std::vector<int32_t> image;
  image.reserve(static_cast<size_t>(num_pixels));
  for (int64_t first = 0; first < num_pixels; first += kBandPixels) {
    std::vector<int32_t> pixels(static_cast<size_t>(std::min(kBandPixels, num_pixels - first)));
    std::iota(pixels.begin(), pixels.end(), static_cast<int32_t>(first));
    const std::vector<int32_t> band = IdsOfRows(ToHost(Capture(pixels)), ids);
    image.insert(image.end(), band.begin(), band.end());
  }
  image.resize(static_cast<size_t>(num_pixels));  // shorter if the backend failed
  return image;
}

}  // namespace pepeseg
