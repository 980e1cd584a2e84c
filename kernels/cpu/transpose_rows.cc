#include <cassert>
#include <vector>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {

// A counting sort by Gaussian; stable, so pixels stay ascending.
void CpuBackend::TransposeRows(const TransposeRowsArgs& args) {
  if (failed()) return;
  const RowSpan& rows = args.rows;
  const int64_t num_pixels = rows.first.size - 1;
  const int32_t begin = rows.first[0], end = rows.first[num_pixels];
  std::vector<int32_t> next(args.num_gaussians);  // counts, then the next place of a Gaussian
  for (int32_t e = begin; e < end; ++e) ++next[rows.gaussian[e]];
  int64_t num_touched = 0;
  for (const int32_t count : next) num_touched += count > 0 ? 1 : 0;

  if (!args.gaussian->Reserve(*this, num_touched) || !args.first->Reserve(*this, num_touched + 1) ||
      !args.pixel->Reserve(*this, end - begin) || !args.weight->Reserve(*this, end - begin)) {
    return;
  }
  int32_t *gaussians = args.gaussian->span().data, *first = args.first->span().data;
  int32_t* pixel = args.pixel->span().data;
  float* weight = args.weight->span().data;
  assert(gaussians != nullptr && first != nullptr);
  int32_t place = 0;
  for (int64_t gaussian = 0, touched = 0; gaussian < args.num_gaussians; ++gaussian) {
    const int32_t count = next[gaussian];
    if (count == 0) continue;
    gaussians[touched] = static_cast<int32_t>(gaussian);
    first[touched++] = place;
    next[gaussian] = place;
    place += count;
  }
  first[num_touched] = place;
  for (int64_t p = 0; p < num_pixels; ++p) {
    for (int32_t e = rows.first[p]; e < rows.first[p + 1]; ++e) {
      const int32_t to = next[rows.gaussian[e]]++;
      assert(pixel != nullptr && weight != nullptr);
      pixel[to] = static_cast<int32_t>(p);
      weight[to] = rows.weight[e];
    }
  }
}

}  // namespace pepeseg
