#include "core/query/gaussian_votes.h"

#include <algorithm>
#include <cmath>

#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr double kMaxNearPixels = 49'152;  // pixels that are looked at around a mask
constexpr double kMaxFarPixels = 16'384;   // pixels that are looked at elsewhere, at most
constexpr int kMinMargin = 8;              // width of the border around a mask, pixels

// [left, right) x [top, bottom).
struct PixelBox {
  int left = 0, top = 0, right = 0, bottom = 0;

  bool Contains(int x, int y) const { return x >= left && x < right && y >= top && y < bottom; }
};

struct SampledPixels {
  std::vector<int32_t> pixels;  // y * width + x
  std::vector<double> area;     // pixels that each of them stands for
};

// Returns the mask's bounding box with a margin, because Gaussians at its border reach beyond it.
PixelBox BoxAround(const SegmentResult& result) {
  // box is {left, top, width, height} of the mask, pixels.
  const int margin = std::max(kMinMargin, std::max(result.box[2], result.box[3]) / 8);
  return {std::max(0, result.box[0] - margin), std::max(0, result.box[1] - margin),
          std::min(result.width, result.box[0] + result.box[2] + margin),
          std::min(result.height, result.box[1] + result.box[3] + margin)};
}

// Returns the distance of the pixels of a grid that has at most about max_pixels.
int StrideFor(int width, int height, double max_pixels) {
  return std::max(1,
                  static_cast<int>(std::ceil(std::sqrt(double{1} * width * height / max_pixels))));
}

SampledPixels ChoosePixels(const SegmentResult& result) {
  const PixelBox box = BoxAround(result);
  SampledPixels chosen;
  // Two grids: a fine one around the mask, where Gaussians are decided, and a coarse one elsewhere.
  // The area that a pixel stands for makes their weights comparable.
  const int near = StrideFor(box.right - box.left, box.bottom - box.top, kMaxNearPixels);
  for (int y = box.top + near / 2; y < box.bottom; y += near) {
    for (int x = box.left + near / 2; x < box.right; x += near) {
      chosen.pixels.push_back(y * result.width + x);
    }
  }
  chosen.area.assign(chosen.pixels.size(), double{1} * near * near);
  const int far = StrideFor(result.width, result.height, kMaxFarPixels);
  for (int y = far / 2; y < result.height; y += far) {
    for (int x = far / 2; x < result.width; x += far) {
      if (!box.Contains(x, y)) chosen.pixels.push_back(y * result.width + x);
    }
  }
  chosen.area.resize(chosen.pixels.size(), double{1} * far * far);
  return chosen;
}

// Returns whether a point of the world projects into the image of a view.
bool LooksAt(const ModelView& view, const Eigen::Vector3d& point) {
  // NaN, from a centre of no votes, fails the comparisons at the end.
  const Eigen::Vector3d in_cam = view.cam_from_world * point;
  if (in_cam.z() <= 0) return false;
  const double x = view.camera.fx * in_cam.x() / in_cam.z() + view.camera.cx;
  const double y = view.camera.fy * in_cam.y() / in_cam.z() + view.camera.cy;
  return x >= 0 && x < view.camera.width && y >= 0 && y < view.camera.height;
}

// Appends the views in the middle of `num` equal parts of `from`, or all if there are fewer.
void AppendSpread(const std::vector<const ModelView*>& from, size_t num,
                  std::vector<ModelView>& to) {
  num = std::min(num, from.size());
  for (size_t i = 0; i < num; ++i) to.push_back(*from[(2 * i + 1) * from.size() / (2 * num)]);
}

}  // namespace

std::vector<ModelView> VotingViews(std::span<const ModelView> views, const std::string& prompted,
                                   const Eigen::Vector3d& center, size_t num) {
  std::vector<const ModelView*> looking, others;
  for (const ModelView& view : views) {
    if (view.name != prompted) (LooksAt(view, center) ? looking : others).push_back(&view);
  }
  std::vector<ModelView> chosen;
  AppendSpread(looking, num, chosen);
  AppendSpread(others, num - chosen.size(), chosen);
  return chosen;
}

absl::Status GaussianVotes::Add(const Segmenter& segmenter, const ModelView& view,
                                const SegmentResult& result) {
  const SampledPixels chosen = ChoosePixels(result);
  ASSIGN_OR_RETURN(const PixelRows rows, segmenter.Rows(view, chosen.pixels));
  for (size_t i = 0; i < chosen.pixels.size(); ++i) {
    const bool inside = result.mask.pixels[chosen.pixels[i]] != 0;
    for (int32_t e = rows.first[i]; e < rows.first[i + 1]; ++e) {
      // A Gaussian's vote: METHOD.md section 4, "Selection in 3D".
      const double weight = double{rows.weight[e]} * chosen.area[i];
      seen_[rows.gaussian[e]] += weight;
      if (inside) inside_[rows.gaussian[e]] += weight;
    }
  }
  return absl::OkStatus();
}

Eigen::Vector3d GaussianVotes::CenterInside(const Gaussians& gaussians) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double total = 0;
  for (size_t i = 0; i < inside_.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      sum[axis] += inside_[i] * double{gaussians.Plane(kMeanPlane + axis)[i]};
    }
    total += inside_[i];
  }
  return sum / total;
}

}  // namespace pepeseg
