#include "core/reconstruct/density_plan.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/reconstruct/morton_order.h"
#include "kernels/gaussian_planes.h"

namespace pepeseg {
namespace {

constexpr float kSplitShrink = 1.6f;  // 0.8 times the number of children, as in the reference

struct Row {
  int32_t source;
  bool is_new;
  Eigen::Vector3f mean, log_scale;
};

Eigen::Vector3f VectorAt(const DensityInput& input, int plane, int64_t i) {
  const float* data = input.planes.data();
  return {data[plane * input.count + i], data[(plane + 1) * input.count + i],
          data[(plane + 2) * input.count + i]};
}

Eigen::Quaternionf RotationAt(const DensityInput& input, int64_t i) {
  const Eigen::Vector3f xyz = VectorAt(input, kRotationPlane + 1, i);
  const float w = input.planes[kRotationPlane * input.count + i];
  return Eigen::Quaternionf(w, xyz.x(), xyz.y(), xyz.z()).normalized();
}

float OpacityAt(const DensityInput& input, int64_t i) {
  return 1 / (1 + std::exp(-input.planes[kOpacityPlane * input.count + i]));
}

float MeanGradient(const DensityInput& input, int64_t i) {
  return input.num_visible[i] == 0 ? 0.0f
                                   : input.grad_sum[i] / static_cast<float>(input.num_visible[i]);
}

// Rows to densify, ascending. Each adds one Gaussian.
std::vector<int64_t> Candidates(const DensityInput& input, const DensityRules& rules,
                                const std::vector<int64_t>& kept) {
  std::vector<int64_t> chosen;
  for (const int64_t i : kept) {
    if (MeanGradient(input, i) >= rules.gradient) chosen.push_back(i);
  }
  const int64_t room = std::max<int64_t>(0, rules.max_count - static_cast<int64_t>(kept.size()));
  if (static_cast<int64_t>(chosen.size()) <= room) return chosen;
  std::stable_sort(chosen.begin(), chosen.end(), [&](int64_t a, int64_t b) {
    return MeanGradient(input, a) > MeanGradient(input, b);
  });
  chosen.resize(static_cast<size_t>(room));
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

Row DrawChild(const DensityInput& input, int64_t i, std::mt19937_64& random) {
  std::normal_distribution<float> normal;
  Row child = {static_cast<int32_t>(i), true, VectorAt(input, kMeanPlane, i),
               VectorAt(input, kLogScalePlane, i)};
  Eigen::Vector3f offset;
  for (int axis = 0; axis < 3; ++axis) {
    offset[axis] = normal(random) * std::exp(child.log_scale[axis]);
  }
  child.mean += RotationAt(input, i) * offset;
  child.log_scale.array() -= std::log(kSplitShrink);
  return child;
}

DensityPlan InMortonOrder(const std::vector<Row>& rows) {
  std::vector<float> means(3 * rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) means[axis * rows.size() + i] = rows[i].mean[axis];
  }
  DensityPlan plan;
  plan.mean_and_log_scale.resize(6 * rows.size());
  for (const int64_t from : MortonOrder(means)) {
    const size_t to = plan.source.size();
    plan.source.push_back(rows[from].source);
    plan.is_new.push_back(rows[from].is_new ? 1 : 0);
    for (int axis = 0; axis < 3; ++axis) {
      plan.mean_and_log_scale[axis * rows.size() + to] = rows[from].mean[axis];
      plan.mean_and_log_scale[(3 + axis) * rows.size() + to] = rows[from].log_scale[axis];
    }
  }
  return plan;
}

}  // namespace

DensityPlan PlanDensity(const DensityInput& input, const DensityRules& rules,
                        std::mt19937_64& random) {
  std::vector<int64_t> kept;
  for (int64_t i = 0; i < input.count; ++i) {
    if (OpacityAt(input, i) >= rules.min_opacity) kept.push_back(i);
  }
  const std::vector<int64_t> candidates = Candidates(input, rules, kept);
  std::vector<Row> rows;
  int64_t num_cloned = 0, num_split = 0;
  auto candidate = candidates.begin();
  for (const int64_t i : kept) {
    const bool densify = candidate != candidates.end() && *candidate == i;
    const Row row = {static_cast<int32_t>(i), false, VectorAt(input, kMeanPlane, i),
                     VectorAt(input, kLogScalePlane, i)};
    if (!densify) {
      rows.push_back(row);
      continue;
    }
    ++candidate;
    if (std::exp(row.log_scale.maxCoeff()) <= rules.clone_size) {
      ++num_cloned;
      rows.push_back(row);
      rows.push_back(row);
      rows.back().is_new = true;
    } else {
      ++num_split;
      rows.push_back(DrawChild(input, i, random));
      rows.push_back(DrawChild(input, i, random));
    }
  }
  DensityPlan plan = InMortonOrder(rows);
  plan.num_cloned = num_cloned;
  plan.num_split = num_split;
  plan.num_pruned = input.count - static_cast<int64_t>(kept.size());
  return plan;
}

}  // namespace pepeseg
