#include "core/select/voting_views.h"

#include <algorithm>

namespace pepeseg {
namespace {

bool LooksAt(const ModelView& view, const Eigen::Vector3d& point) {
  const Eigen::Vector3d in_cam = view.cam_from_world * point;
  if (in_cam.z() <= 0) return false;
  const double x = view.camera.fx * in_cam.x() / in_cam.z() + view.camera.cx;
  const double y = view.camera.fy * in_cam.y() / in_cam.z() + view.camera.cy;
  return x >= 0 && x < view.camera.width && y >= 0 && y < view.camera.height;
}

// The middles of `num` equal stretches.
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

}  // namespace pepeseg
