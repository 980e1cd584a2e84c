#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/gaussians.h"

namespace pepeseg {

// Encodes a subset of Gaussians as a file of some format, in blocks, so that a caller can stream it
// without holding it. A block has the same bytes each time that it is encoded. Thread safe.
class GaussianBlocks {
 public:
  static constexpr int64_t kMaxBlockBytes = int64_t{1} << 20;

  virtual ~GaussianBlocks() = default;

  int64_t num_gaussians() const { return static_cast<int64_t>(indices_.size()); }
  virtual int64_t num_blocks() const = 0;  // at least 1
  // Returns a block, 0 <= block < num_blocks(), of at most kMaxBlockBytes.
  virtual std::string Encode(int64_t block) const = 0;

 protected:
  // Encodes the Gaussians at `indices`, in that order. `gaussians` must outlive the object.
  GaussianBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices)
      : gaussians_(gaussians), indices_(std::move(indices)) {}
  // Returns a parameter of the Gaussian in a row of the file.
  float ValueOf(int plane, int64_t row) const { return gaussians_.Plane(plane)[IndexOf(row)]; }
  // Returns the opacity of the Gaussian in a row, 0 to 1.
  float OpacityOf(int64_t row) const { return 1 / (1 + std::exp(-ValueOf(kOpacityPlane, row))); }
  // Returns the Gaussian of a row.
  size_t IndexOf(int64_t row) const { return indices_[static_cast<size_t>(row)]; }

  const Gaussians& gaussians_;

 private:
  std::vector<uint32_t> indices_;
};

// A file that is a header and a row of the same size for each Gaussian.
class GaussianRowBlocks : public GaussianBlocks {
 public:
  int64_t num_blocks() const override {
    return 1 + (num_gaussians() + rows_per_block() - 1) / rows_per_block();
  }
  // Sum over all blocks.
  int64_t num_bytes() const {
    return static_cast<int64_t>(header_.size()) + num_gaussians() * row_bytes_;
  }
  // Block 0 is the header.
  std::string Encode(int64_t block) const override {
    if (block == 0) return header_;
    const int64_t first = (block - 1) * rows_per_block();
    return EncodeRows(first, std::min(rows_per_block(), num_gaussians() - first));
  }

 protected:
  using GaussianBlocks::GaussianBlocks;
  // Sets what the file consists of. The constructor of each format calls it.
  void SetLayout(std::string header, int64_t row_bytes) {
    header_ = std::move(header);
    row_bytes_ = row_bytes;
  }
  int64_t row_bytes() const { return row_bytes_; }
  // Returns rows [first, first + count).
  virtual std::string EncodeRows(int64_t first, int64_t count) const = 0;

 private:
  // Blocks end between rows.
  int64_t rows_per_block() const { return kMaxBlockBytes / row_bytes_; }

  std::string header_;
  int64_t row_bytes_ = 1;  // at most kMaxBlockBytes
};

}  // namespace pepeseg
