#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "core/formats/gaussian_blocks.h"
#include "core/scene/gaussians.h"

namespace pepeseg {

// A subset of Gaussians as SPZ, version 3 (https://github.com/nianticlabs/spz): gzip of a header
// and of one array for each parameter, with 8 bits a number, 24 for each coordinate and 32 for a
// rotation. Coordinates are multiples of a power of two that is at most 1/65536 of the
// greatest coordinate of the median Gaussian. SH coefficients of degree 1 have 5 bits, of degree 2
// and 3 four, within [-1, 1]. The axes are those of glTF (y_up.h), the positions relative to the
// model's origin.
class GaussianSpzBlocks : public GaussianBlocks {
 public:
  // See GaussianBlocks. The file has the coefficients of degree up to `max_sh_degree`.
  GaussianSpzBlocks(const Gaussians& gaussians, std::vector<uint32_t> indices,
                    int max_sh_degree = kMaxShDegree);

  int64_t num_blocks() const override { return static_cast<int64_t>(pieces_.size()); }
  std::string Encode(int64_t block) const override;

 private:
  // The arrays of the file, in their order.
  enum class Array { kHeader, kPositions, kAlphas, kColors, kScales, kRotations, kSh };
  // Rows of one array. Each piece is compressed by itself.
  struct Piece {
    Array array;
    int64_t first, count;
  };

  int64_t RowBytesOf(Array array) const;
  std::string RowsOf(const Piece& piece) const;
  void AppendRow(Array array, int64_t row, std::string& bytes) const;
  // Returns the end of the gzip file: its checksum and size.
  std::string Trailer() const;

  const int sh_degree_;
  int fractional_bits_ = 0;
  std::vector<Piece> pieces_;
  mutable std::once_flag summed_;
  mutable std::string trailer_;  // guarded by summed_
};

}  // namespace pepeseg
