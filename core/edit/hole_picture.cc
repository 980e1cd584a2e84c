#include "core/edit/hole_picture.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>

namespace pepeseg {
namespace {

// The pixels next to pixel `i`, up to four.
struct Neighbors {
  std::array<size_t, 4> pixel{};
  size_t num = 0;
};
Neighbors NeighborsOf(size_t i, int width, int height) {
  const auto w = static_cast<size_t>(width);
  const size_t x = i % w, y = i / w;
  Neighbors neighbors;
  if (x > 0) neighbors.pixel[neighbors.num++] = i - 1;
  if (x + 1 < w) neighbors.pixel[neighbors.num++] = i + 1;
  if (y > 0) neighbors.pixel[neighbors.num++] = i - w;
  if (y + 1 < static_cast<size_t>(height)) neighbors.pixel[neighbors.num++] = i + w;
  return neighbors;
}

// Calls visit(pixel, is in the hole) for the pixels of the connected part of the hole with `first`
// and, once for each side that touches it, those next to it. Marks the part as `seen`.
template <class Visit>
void VisitPart(const HolePicture& picture, size_t first, std::vector<uint8_t>& seen,
               const Visit& visit) {
  std::vector<size_t> open = {first};
  seen[first] = 1;
  while (!open.empty()) {
    const size_t i = open.back();
    open.pop_back();
    visit(i, true);
    const Neighbors neighbors = NeighborsOf(i, picture.width, picture.height);
    for (size_t k = 0; k < neighbors.num; ++k) {
      const size_t j = neighbors.pixel[k];
      if (picture.hole[j] == 0) {
        visit(j, false);
      } else if (seen[j] == 0) {
        seen[j] = 1;
        open.push_back(j);
      }
    }
  }
}

}  // namespace

int64_t KeepEnclosed(double min_known, HolePicture& picture) {
  std::vector<uint8_t> seen(picture.num_pixels());
  std::vector<size_t> dropped;
  int64_t num_left = 0;
  for (size_t first = 0; first < picture.num_pixels(); ++first) {
    if (picture.hole[first] == 0 || seen[first] != 0) continue;
    std::vector<size_t> part;
    int64_t num_border = 0, num_known = 0;
    VisitPart(picture, first, seen, [&](size_t pixel, bool in_hole) {
      if (in_hole) {
        part.push_back(pixel);
      } else {
        ++num_border;
        num_known += picture.known[pixel];
      }
    });
    if (num_known > 0 &&
        static_cast<double>(num_known) >= min_known * static_cast<double>(num_border)) {
      num_left += static_cast<int64_t>(part.size());
    } else {
      dropped.insert(dropped.end(), part.begin(), part.end());
    }
  }
  for (const size_t pixel : dropped) picture.hole[pixel] = 0;
  return num_left;
}

void FillSmoothly(HolePicture& picture) {
  std::vector<int> row_of(picture.num_pixels(), -1);
  int num_rows = 0;
  for (size_t i = 0; i < picture.num_pixels(); ++i) {
    if (picture.hole[i] != 0) row_of[i] = num_rows++;
  }
  if (num_rows == 0) return;
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(num_rows, picture.values.cols());
  for (size_t i = 0; i < picture.num_pixels(); ++i) {
    if (row_of[i] < 0) continue;
    double num = 0;
    const Neighbors neighbors = NeighborsOf(i, picture.width, picture.height);
    for (size_t k = 0; k < neighbors.num; ++k) {
      const size_t j = neighbors.pixel[k];
      if (row_of[j] >= 0) {
        entries.emplace_back(row_of[i], row_of[j], -1);
      } else if (picture.known[j] != 0) {
        right.row(row_of[i]) += picture.values.row(static_cast<Eigen::Index>(j));
      } else {
        continue;
      }
      num += 1;
    }
    entries.emplace_back(row_of[i], row_of[i], num);
  }
  Eigen::SparseMatrix<double> laplacian(num_rows, num_rows);
  laplacian.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(laplacian);
  const Eigen::MatrixXd filled = solver.solve(right);
  for (size_t i = 0; i < picture.num_pixels(); ++i) {
    if (row_of[i] >= 0) picture.values.row(static_cast<Eigen::Index>(i)) = filled.row(row_of[i]);
  }
}

std::vector<uint8_t> Dilated(std::span<const uint8_t> mask, int width, int height, int radius) {
  // Along rows, then along columns.
  const auto along = [&](std::span<const uint8_t> from, int step, int size, int num_lines,
                         int line_step) {
    std::vector<uint8_t> to(from.size());
    for (int line = 0; line < num_lines; ++line) {
      const size_t first = static_cast<size_t>(line) * line_step;
      for (int i = 0; i < size; ++i) {
        if (from[first + static_cast<size_t>(i) * step] == 0) continue;
        for (int j = std::max(0, i - radius); j <= std::min(size - 1, i + radius); ++j) {
          to[first + static_cast<size_t>(j) * step] = 1;
        }
      }
    }
    return to;
  };
  return along(along(mask, 1, width, height, width), width, height, width, 1);
}

}  // namespace pepeseg
