#include "core/sfm/mapper/bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/sfm/two_view/relative_pose.h"

namespace pepeseg {
namespace {

using Matrix2x3 = Eigen::Matrix<double, 2, 3>;
using Matrix2x6 = Eigen::Matrix<double, 2, 6>;
using Matrix6x3 = Eigen::Matrix<double, 6, 3>;

constexpr int64_t kPointsPerTask = 256;
// Unknowns of a lens: focal length, k1, and the principal point.
constexpr int kLens = 4;
using Matrix2xL = Eigen::Matrix<double, 2, kLens>;
using MatrixLx3 = Eigen::Matrix<double, kLens, 3>;

// The linearised observation of a point. Rows are scaled by the root of the loss's weight.
struct Linear {
  Matrix2x6 pose;
  Matrix2xL lens;
  Matrix2x3 point;
  Eigen::Vector2d residual;
};

// Terms of the normal equations from which a point is eliminated. `lens` couples it with its
// camera groups.
struct PointEquations {
  Eigen::Matrix3d inverse;
  Eigen::Vector3d gradient;
  std::vector<std::pair<int, MatrixLx3>> lens;
};

// An adjustment of one model.
class Bundle {
 public:
  Bundle(std::span<const MapperPhotograph> photographs, const BundleOptions& options,
         ThreadPool& pool, GlobalModel& model)
      : photographs_(photographs), options_(options), pool_(pool), model_(model) {
    column_.assign(photographs.size(), -1);
    for (size_t i = 0; i < photographs.size(); ++i) {
      if (!model.poses[i].is_registered) continue;
      column_[i] = static_cast<Eigen::Index>(6 * members_.size());
      members_.push_back(static_cast<uint32_t>(i));
    }
    lens_begin_ = static_cast<Eigen::Index>(6 * members_.size());
    size_ = lens_begin_ + static_cast<Eigen::Index>(kLens * model.lenses.size());
    seen_by_.resize(photographs.size());
    begin_.push_back(0);
    for (uint32_t p = 0; p < model.points.size(); ++p) {
      for (const Observation& o : model.points[p].track) {
        seen_by_[o.photograph].push_back(static_cast<uint32_t>(observations_.size()));
        observations_.push_back(o);
        point_of_.push_back(p);
      }
      begin_.push_back(static_cast<uint32_t>(observations_.size()));
    }
    linear_.resize(observations_.size());
    equations_.resize(model.points.size());
    num_tasks_ = (static_cast<int64_t>(model.points.size()) + kPointsPerTask - 1) / kPointsPerTask;
  }

  BundleSummary Run();

 private:
  template <typename Body>
  void ForPoints(const Body& body) {
    pool_.ParallelFor(num_tasks_, [&](int64_t task, int) {
      const int64_t end = std::min<int64_t>((task + 1) * kPointsPerTask, equations_.size());
      for (int64_t p = task * kPointsPerTask; p < end; ++p) body(static_cast<uint32_t>(p), task);
    });
  }
  int GroupOf(const Observation& o) const { return photographs_[o.photograph].camera_group; }
  bool FreesCentre(size_t group) const {
    return group < options_.free_centres.size() && options_.free_centres[group];
  }
  Eigen::Index LensColumn(int group) const { return lens_begin_ + kLens * group; }

  double Cost();
  void Linearise(const Observation& o, const Eigen::Vector3d& position, Linear& linear) const;
  void EliminatePoint(uint32_t p, double damping);
  void FillLensRows(double damping);
  void FillPhotograph(uint32_t photograph, double damping);
  // Builds the reduced equations and solves them.
  bool Solve(double damping, Eigen::VectorXd& step);
  std::vector<Eigen::Vector2d> CentreDeviations(double cost);
  void Apply(const Eigen::VectorXd& step);

  std::span<const MapperPhotograph> photographs_;
  const BundleOptions& options_;
  ThreadPool& pool_;
  GlobalModel& model_;
  std::vector<uint32_t> members_;     // registered photographs
  std::vector<Eigen::Index> column_;  // of each photograph, or -1
  Eigen::Index lens_begin_ = 0, size_ = 0;
  std::vector<Observation> observations_;  // by point
  std::vector<uint32_t> point_of_, begin_;
  std::vector<std::vector<uint32_t>> seen_by_;  // observations of each photograph
  std::vector<Linear> linear_;
  std::vector<PointEquations> equations_;
  int64_t num_tasks_ = 0;
  // The reduced equations; upper triangle.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> matrix_;
  Eigen::VectorXd right_;
};

double Bundle::Cost() {
  std::vector<double> sums(num_tasks_, 0.0);
  const double scale = options_.loss_scale * options_.loss_scale;
  ForPoints([&](uint32_t p, int64_t task) {
    for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
      const double error =
          ReprojectionError(photographs_, model_, model_.points[p].position, observations_[i]);
      sums[task] += 2 * scale * (std::sqrt(1 + error * error / scale) - 1);
    }
  });
  double sum = 0;
  for (const double part : sums) sum += part;
  return sum;
}

void Bundle::Linearise(const Observation& o, const Eigen::Vector3d& position,
                       Linear& linear) const {
  const CameraPose& pose = model_.poses[o.photograph];
  const GroupLens& lens = model_.lenses[GroupOf(o)];
  const Eigen::Vector3d turned = pose.rotation * position, seen = turned + pose.translation;
  const Eigen::Vector2d u = seen.head<2>() / seen.z();
  const double rr = u.squaredNorm(), factor = 1 + lens.k1 * rr;
  linear.residual = lens.focal * factor * u + lens.Centre() - PixelOf(photographs_, o);
  const double ratio = linear.residual.squaredNorm() / (options_.loss_scale * options_.loss_scale);
  const double root = std::pow(1 + ratio, -0.25);
  const Eigen::Matrix2d by_u =
      root * lens.focal * (factor * Eigen::Matrix2d::Identity() + 2 * lens.k1 * u * u.transpose());
  Matrix2x3 by_seen;
  by_seen << by_u / seen.z(), -by_u * u / seen.z();
  // The rotation's step w turns the point by w x turned.
  if (options_.fix_rotations) {
    linear.pose.leftCols<3>().setZero();
  } else {
    for (int row = 0; row < 2; ++row) {
      linear.pose.row(row).head<3>() = turned.cross(by_seen.row(row).transpose()).transpose();
    }
  }
  linear.pose.rightCols<3>() = by_seen;
  linear.point = by_seen * pose.rotation;
  if (options_.fix_lenses) {
    linear.lens.setZero();
  } else {
    // The focal length's step is relative.
    linear.lens.col(0) = root * lens.focal * factor * u;
    linear.lens.col(1) = root * lens.focal * rr * u;
    linear.lens.rightCols<2>().setZero();
    if (FreesCentre(GroupOf(o))) linear.lens.rightCols<2>() = root * Eigen::Matrix2d::Identity();
  }
  linear.residual *= root;
}

void Bundle::EliminatePoint(uint32_t p, double damping) {
  PointEquations& equations = equations_[p];
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
  equations.gradient.setZero();
  equations.lens.clear();
  for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
    Linear& linear = linear_[i];
    Linearise(observations_[i], model_.points[p].position, linear);
    curvature += linear.point.transpose() * linear.point;
    equations.gradient += linear.point.transpose() * linear.residual;
    const int group = GroupOf(observations_[i]);
    auto found = std::find_if(equations.lens.begin(), equations.lens.end(),
                              [&](const auto& entry) { return entry.first == group; });
    if (found == equations.lens.end()) {
      found = equations.lens.insert(found, {group, MatrixLx3::Zero()});
    }
    found->second += linear.lens.transpose() * linear.point;
  }
  curvature.diagonal() += damping * curvature.diagonal() + Eigen::Vector3d::Constant(1e-12);
  equations.inverse = curvature.inverse();
}

// Sums the rows of the lenses: few numbers, added up in the order of the observations.
void Bundle::FillLensRows(double damping) {
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Eigen::Index column = LensColumn(GroupOf(observations_[i]));
    matrix_.block<kLens, kLens>(column, column) += linear_[i].lens.transpose() * linear_[i].lens;
    right_.segment<kLens>(column) -= linear_[i].lens.transpose() * linear_[i].residual;
  }
  for (size_t g = 0; g < model_.lenses.size(); ++g) {
    for (Eigen::Index i = LensColumn(static_cast<int>(g));
         i < LensColumn(static_cast<int>(g)) + kLens; ++i) {
      // A lens that nothing moves keeps its place.
      matrix_(i, i) += damping * matrix_(i, i) + (matrix_(i, i) > 0 ? 1e-12 : 1.0);
    }
  }
  for (const PointEquations& equations : equations_) {
    for (const auto& [a, coupling_a] : equations.lens) {
      const MatrixLx3 reach = coupling_a * equations.inverse;
      right_.segment<kLens>(LensColumn(a)) += reach * equations.gradient;
      for (const auto& [b, coupling_b] : equations.lens) {
        if (b >= a) {
          matrix_.block<kLens, kLens>(LensColumn(a), LensColumn(b)) -=
              reach * coupling_b.transpose();
        }
      }
    }
  }
}

// Sums the rows of one photograph. No other task touches them.
void Bundle::FillPhotograph(uint32_t photograph, double damping) {
  const Eigen::Index row = column_[photograph];
  const Eigen::Index own_lens = LensColumn(photographs_[photograph].camera_group);
  Eigen::Matrix<double, 6, 6> own = Eigen::Matrix<double, 6, 6>::Zero();
  for (const uint32_t i : seen_by_[photograph]) {
    const Linear& linear = linear_[i];
    own += linear.pose.transpose() * linear.pose;
    right_.segment<6>(row) -= linear.pose.transpose() * linear.residual;
    matrix_.block<6, kLens>(row, own_lens) += linear.pose.transpose() * linear.lens;
  }
  for (int k = 0; k < 6; ++k) own(k, k) += damping * own(k, k) + (own(k, k) > 0 ? 1e-12 : 1.0);
  matrix_.block<6, 6>(row, row) += own;
  for (const uint32_t i : seen_by_[photograph]) {
    const uint32_t p = point_of_[i];
    const PointEquations& equations = equations_[p];
    const Matrix6x3 coupling = linear_[i].pose.transpose() * linear_[i].point;
    const Matrix6x3 reach = coupling * equations.inverse;
    right_.segment<6>(row).noalias() += reach * equations.gradient;
    for (const auto& [group, lens] : equations.lens) {
      matrix_.block<6, kLens>(row, LensColumn(group)).noalias() -= reach * lens.transpose();
    }
    for (uint32_t j = begin_[p]; j < begin_[p + 1]; ++j) {
      const Eigen::Index other = column_[observations_[j].photograph];
      if (other < row) continue;
      const Eigen::Matrix<double, 6, 2> half = reach * linear_[j].point.transpose();
      matrix_.block<6, 6>(row, other).noalias() -= half * linear_[j].pose;
    }
  }
}

bool Bundle::Solve(double damping, Eigen::VectorXd& step) {
  matrix_.setZero(size_, size_);
  right_.setZero(size_);
  ForPoints([&](uint32_t p, int64_t) { EliminatePoint(p, damping); });
  FillLensRows(damping);
  pool_.ParallelFor(static_cast<int64_t>(members_.size()),
                    [&](int64_t i, int) { FillPhotograph(members_[i], damping); });
  // Row-major, so that its upper triangle is the lower one of the column-major matrix.
  const Eigen::Map<const Eigen::MatrixXd> lower(matrix_.data(), size_, size_);
  const Eigen::LLT<Eigen::MatrixXd> solver(lower);
  if (solver.info() != Eigen::Success) return false;
  step = solver.solve(right_);
  return step.allFinite();
}

// Reads the variances of the lenses from the inverse of the undamped reduced matrix.
std::vector<Eigen::Vector2d> Bundle::CentreDeviations(double cost) {
  std::vector<Eigen::Vector2d> deviations(model_.lenses.size(),
                                          Eigen::Vector2d::Constant(INFINITY));
  const auto free = 2 * static_cast<double>(observations_.size()) -
                    3 * static_cast<double>(equations_.size()) - static_cast<double>(size_);
  if (options_.free_centres.empty() || options_.fix_lenses || free <= 0) return deviations;
  // Positions, rotation and scale of the whole are free: a little damping makes it invertible.
  if (Eigen::VectorXd step; !Solve(1e-9, step)) return deviations;
  const Eigen::LLT<Eigen::MatrixXd> solver(
      Eigen::Map<const Eigen::MatrixXd>(matrix_.data(), size_, size_));
  for (size_t g = 0; g < deviations.size(); ++g) {
    for (int k = 0; k < 2 && FreesCentre(g); ++k) {
      const Eigen::Index column = LensColumn(static_cast<int>(g)) + 2 + k;
      const double variance = solver.solve(Eigen::VectorXd::Unit(size_, column))[column];
      deviations[g][k] = std::sqrt(variance * cost / free);
    }
  }
  return deviations;
}

void Bundle::Apply(const Eigen::VectorXd& step) {
  ForPoints([&](uint32_t p, int64_t) {
    const PointEquations& equations = equations_[p];
    Eigen::Vector3d pulled = -equations.gradient;
    for (uint32_t i = begin_[p]; i < begin_[p + 1]; ++i) {
      const Linear& linear = linear_[i];
      pulled -= linear.point.transpose() *
                (linear.pose * step.segment<6>(column_[observations_[i].photograph]) +
                 linear.lens * step.segment<kLens>(LensColumn(GroupOf(observations_[i]))));
    }
    model_.points[p].position += equations.inverse * pulled;
  });
  for (const uint32_t i : members_) {
    CameraPose& pose = model_.poses[i];
    if (!options_.fix_rotations) {
      pose.rotation = RotationFromVector(step.segment<3>(column_[i])) * pose.rotation;
    }
    pose.translation += step.segment<3>(column_[i] + 3);
  }
  for (size_t g = 0; g < model_.lenses.size(); ++g) {
    if (options_.fix_lenses) break;
    const Eigen::Index column = LensColumn(static_cast<int>(g));
    model_.lenses[g].focal *= std::exp(step[column]);
    model_.lenses[g].k1 += step[column + 1];
    if (FreesCentre(g)) model_.lenses[g].shift += step.segment<2>(column + 2);
  }
}

BundleSummary Bundle::Run() {
  BundleSummary summary;
  double damping = 1e-4, cost = Cost();
  summary.first_cost = summary.last_cost = cost;
  while (summary.num_steps < options_.max_steps && !observations_.empty()) {
    ++summary.num_steps;
    Eigen::VectorXd step;
    double moved_cost = INFINITY;
    const std::vector<GroupLens> lenses = model_.lenses;
    const std::vector<CameraPose> poses = model_.poses;
    std::vector<Eigen::Vector3d> positions;
    for (const MappedPoint& point : model_.points) positions.push_back(point.position);
    if (Solve(damping, step)) {
      Apply(step);
      moved_cost = Cost();
    }
    if (moved_cost < cost) {
      const bool done = moved_cost > cost * (1 - options_.min_decrease);
      cost = moved_cost;
      damping = std::max(damping / 10, 1e-10);
      if (done) break;
      continue;
    }
    model_.lenses = lenses, model_.poses = poses;
    for (size_t p = 0; p < positions.size(); ++p) model_.points[p].position = positions[p];
    damping *= 20;
    if (damping > 1e4) break;
  }
  summary.last_cost = cost;
  summary.centre_deviations = CentreDeviations(cost);
  return summary;
}

}  // namespace

BundleSummary AdjustBundle(std::span<const MapperPhotograph> photographs,
                           const BundleOptions& options, ThreadPool& pool, GlobalModel& model) {
  return Bundle(photographs, options, pool, model).Run();
}

}  // namespace pepeseg
