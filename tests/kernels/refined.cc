#include "tests/kernels/refined.h"

#include <algorithm>
#include <numeric>

namespace pepeseg {

Refined::Refined(Backend& backend, const HostGaussians& scene, const PinholeView& view,
                 const MaskImages& masks)
    : rendered(backend, scene, view),
      words(static_cast<int>(masks.size() + 63) / 64),
      refinable(backend, scene.count),
      outside_source(backend, scene.count),
      outside_shape(backend, 6 * scene.count),
      counts(backend, kNumRefineCounts) {
  // One mask cell for each pixel: the map need not be minimal.
  const int64_t num_pixels = int64_t{view.width} * view.height;
  std::vector<uint32_t> cells(num_pixels);
  std::iota(cells.begin(), cells.end(), 0);
  std::vector<uint64_t> bits(num_pixels * words);
  std::vector<int64_t> areas;
  for (size_t mask = 0; mask < masks.size(); ++mask) {
    for (int64_t pixel = 0; pixel < num_pixels; ++pixel) {
      if (masks[mask][pixel] != 0) bits[pixel * words + mask / 64] |= uint64_t{1} << mask % 64;
    }
    areas.push_back(std::count(masks[mask].begin(), masks[mask].end(), 1));
  }
  pixel_cell = Buffer<uint32_t>(backend, std::span<const uint32_t>(cells));
  cell_bits = Buffer<uint64_t>(backend, std::span<const uint64_t>(bits));
  mask_area = Buffer<int64_t>(backend, std::span<const int64_t>(areas));
  refinable.Upload(std::vector<int32_t>(scene.count, 1));
  const std::vector<float> sevens(scene.planes.size(), 7);
  rendered.moment1.Upload(sevens);
  rendered.moment2.Upload(sevens);
  rendered.num_steps.Upload(std::vector<int32_t>(scene.count, 7));
  rendered.Render();
}

RefineGaussiansArgs Refined::MakeArgs() {
  RefineGaussiansArgs args;
  args.view = rendered.view;
  args.masks = {words, pixel_cell.span(), cell_bits.span(), mask_area.span()};
  args.alpha = rendered.alpha.span();
  args.depth = rendered.depth.span();
  args.candidate_share = 1;
  args.render = &rendered.scratch;
  args.scratch = &scratch;
  args.gaussians = PlanesIn(rendered.gaussians, rendered.host);
  args.moment1 = PlanesIn(rendered.moment1, rendered.host);
  args.moment2 = PlanesIn(rendered.moment2, rendered.host);
  args.num_steps = rendered.num_steps.span();
  args.refinable = refinable.span();
  args.outside_source = outside_source.span();
  args.outside_shape = outside_shape.span();
  args.counts = counts.span();
  return args;
}

HostGaussians Refined::Result() const {
  return {rendered.host.count, rendered.host.sh_degree, Download(rendered.gaussians)};
}

}  // namespace pepeseg
