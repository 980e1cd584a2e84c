#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// Dot products of descriptors in tiles of some rows and the columns of two vectors, one lane for a
// column. A tile of products lives in registers only: it is merged at once into the best two of
// its rows and of its columns.
//
// Layout. Columns are packed in groups of kGroup. A step is 4 bytes of each column of a group: four
// bytes, or two 16-bit numbers. Rows are packed by blocks of kBlockRows in the same steps; a step
// of a row is broadcast to all lanes. Padding is zeros, whose products are 0 and never the best.
//
// Loops. For a block of rows the group of columns (4 to 8 KB) is read once and stays in the first
// cache, as does the state of the rows.

using IntVec = hn::Vec<IntTag>;
constexpr int kTileRows = kLanes == 16 ? 8 : 4;
constexpr int kTileVectors = 2;
constexpr int kGroup = kTileVectors * kLanes;
constexpr int kBlockRows = 64;
static_assert(kMatchPadding % kGroup == 0 && kBlockRows % kTileRows == 0);

// Products of 16-bit numbers, added in pairs. On x86-64 this is one instruction and an addition.
struct Words {
  using Element = int16_t;
  static constexpr int kSteps = kDescriptorBytes / 2;

  static PEPESEG_HD int16_t Column(uint8_t byte) { return byte; }
  static PEPESEG_HD int16_t Row(uint8_t byte) { return byte; }
  static PEPESEG_HD int32_t Bias(const uint8_t*) { return 0; }
  static PEPESEG_HD void Add(IntVec columns, const int32_t* row, IntVec& sum) {
    const IntTag d;
    const IntVec steps = hn::Set(d, *row);
#if HWY_ARCH_X86
    const hn::Repartition<int16_t, IntTag> words;
    IntVec none = hn::Zero(d);
    sum = hn::ReorderWidenMulAccumulate(d, hn::BitCast(words, columns), hn::BitCast(words, steps),
                                        sum, none);
#else
    const IntVec odd = hn::Mul(hn::ShiftRight<16>(columns), hn::ShiftRight<16>(steps));
    const IntVec even = hn::Mul(hn::ShiftRight<16>(hn::ShiftLeft<16>(columns)),
                                hn::ShiftRight<16>(hn::ShiftLeft<16>(steps)));
    sum = hn::Add(sum, hn::Add(odd, even));
#endif
  }
};

#if HWY_TARGET == HWY_AVX3
// Products of bytes, added in fours by AVX-512 VNNI. One factor is signed, so that 128 is taken
// from the rows and 128 times the sum of a column is added at the start.
struct Bytes {
  using Element = uint8_t;
  static constexpr int kSteps = kDescriptorBytes / 4;

  static PEPESEG_HD uint8_t Column(uint8_t byte) { return byte; }
  static PEPESEG_HD uint8_t Row(uint8_t byte) { return byte ^ 0x80; }
  static PEPESEG_HD int32_t Bias(const uint8_t* column) {
    int32_t sum = 0;
    for (int k = 0; k < kDescriptorBytes; ++k) sum += column[k];
    return 128 * sum;
  }
  // The set of this file lacks VNNI, so its instruction has no intrinsic here.
  static PEPESEG_HD void Add(IntVec columns, const int32_t* row, IntVec& sum) {
    asm("vpdpbusd %2%{1to16%}, %1, %0" : "+v"(sum.raw) : "v"(columns.raw), "m"(*row));
  }
};
#endif

// The best two products of kLanes rows or columns, or of a row by lane.
struct NearestLanes {
  IntVec best, second, index;

  static PEPESEG_HD NearestLanes Load(const int32_t* p) {
    const IntTag d;
    return {hn::LoadU(d, p), hn::LoadU(d, p + kLanes), hn::LoadU(d, p + 2 * kLanes)};
  }
  PEPESEG_HD void Store(int32_t* p) const {
    const IntTag d;
    hn::StoreU(best, d, p);
    hn::StoreU(second, d, p + kLanes);
    hn::StoreU(index, d, p + 2 * kLanes);
  }
  // As Offer of kernels/math/match.h.
  PEPESEG_HD void Offer(IntVec dot, IntVec of_index) {
    second = hn::Max(second, hn::Min(best, dot));
    index = hn::IfThenElse(hn::Gt(dot, best), of_index, index);
    best = hn::Max(best, dot);
  }
};
constexpr int kStateSize = 3 * kLanes;

PEPESEG_HD void Clear(int32_t* states, int64_t count) {
  const IntTag d;
  const NearestLanes none = {hn::Zero(d), hn::Zero(d), hn::Set(d, -1)};
  for (int64_t i = 0; i < count; ++i) none.Store(states + i * kStateSize);
}

template <class Product>
PEPESEG_HD void PackRows(const uint8_t* rows, int count, typename Product::Element* packed) {
  for (int i = 0; i < kBlockRows * kDescriptorBytes; ++i) {
    packed[i] = Product::Row(i < count * kDescriptorBytes ? rows[i] : 0);
  }
}

// Packs columns, [padded] times 128 elements, and writes what their sums start from.
template <class Product>
PEPESEG_HD void PackColumns(const MatchJob& job) {
  using Element = typename Product::Element;
  constexpr int kPerStep = 4 / sizeof(Element);
  auto* packed = static_cast<Element*>(job.packed);
  const int32_t padded = (job.num_columns + kGroup - 1) / kGroup * kGroup;
  for (int32_t column = 0; column < padded; ++column) {
    Element* to =
        packed + int64_t{column / kGroup} * kGroup * kDescriptorBytes + column % kGroup * kPerStep;
    const bool padding = column >= job.num_columns;
    const uint8_t* from = job.columns + (padding ? 0 : int64_t{column} * kDescriptorBytes);
    for (int step = 0; step < Product::kSteps; ++step) {
      for (int k = 0; k < kPerStep; ++k) {
        to[step * kGroup * kPerStep + k] = padding ? 0 : Product::Column(from[step * kPerStep + k]);
      }
    }
    job.bias[column] = padding ? 0 : Product::Bias(from);
  }
}

struct Tile {
  IntVec dot[kTileRows][kTileVectors];
};

// Computes the products of kTileRows packed rows and a group of columns.
template <class Product>
PEPESEG_HD void TileDots(const int32_t* rows, const int32_t* columns, const int32_t* bias,
                         Tile& tile) {
  const IntTag d;
  HWY_UNROLL(kTileRows)
  for (int i = 0; i < kTileRows; ++i) {
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) tile.dot[i][v] = hn::LoadU(d, bias + v * kLanes);
  }
  for (int step = 0; step < Product::kSteps; ++step) {
    IntVec column[kTileVectors];
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) {
      column[v] = hn::LoadU(d, columns + step * kGroup + v * kLanes);
    }
    HWY_UNROLL(kTileRows)
    for (int i = 0; i < kTileRows; ++i) {
      HWY_UNROLL(kTileVectors)
      for (int v = 0; v < kTileVectors; ++v) {
        Product::Add(column[v], rows + i * Product::kSteps + step, tile.dot[i][v]);
      }
    }
  }
}

// Compares a block of rows, from row `first` on, with all columns.
template <class Product>
PEPESEG_HD void BlockDots(const MatchJob& job, int32_t first, const int32_t* rows,
                          int32_t* row_states) {
  const IntTag d;
  const int num_tiles = (HWY_MIN(job.num_rows - first, kBlockRows) + kTileRows - 1) / kTileRows;
  for (int32_t group = 0; group * kGroup < job.num_columns; ++group) {
    const int32_t* columns =
        static_cast<const int32_t*>(job.packed) + int64_t{group} * kGroup * Product::kSteps;
    int32_t* column_states = job.column_states + int64_t{group} * kTileVectors * kStateSize;
    NearestLanes of_columns[kTileVectors];
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) {
      of_columns[v] = NearestLanes::Load(column_states + v * kStateSize);
    }
    for (int t = 0; t < num_tiles; ++t) {
      Tile tile;
      TileDots<Product>(rows + t * kTileRows * Product::kSteps, columns, job.bias + group * kGroup,
                        tile);
      // Unrolled, so that the tile stays in registers.
      HWY_UNROLL(kTileRows)
      for (int i = 0; i < kTileRows; ++i) {
        const int row = t * kTileRows + i;
        NearestLanes of_row = NearestLanes::Load(row_states + row * kStateSize);
        HWY_UNROLL(kTileVectors)
        for (int v = 0; v < kTileVectors; ++v) {
          of_row.Offer(tile.dot[i][v], hn::Iota(d, group * kGroup + v * kLanes));
          of_columns[v].Offer(tile.dot[i][v], hn::Set(d, first + row));
        }
        of_row.Store(row_states + row * kStateSize);
      }
    }
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) of_columns[v].Store(column_states + v * kStateSize);
  }
}

PEPESEG_HD NearestDots LaneOf(const int32_t* state, int lane) {
  return {state[lane], state[kLanes + lane], state[2 * kLanes + lane]};
}

template <class Product>
PEPESEG_HD void FindNearest(const MatchJob& job) {
  if (!job.is_packed) PackColumns<Product>(job);
  const int32_t num_vectors = (job.num_columns + kGroup - 1) / kGroup * kTileVectors;
  Clear(job.column_states, num_vectors);
  alignas(64) typename Product::Element packed[kBlockRows * kDescriptorBytes];
  alignas(64) int32_t row_states[kBlockRows * kStateSize];
  for (int32_t first = 0; first < job.num_rows; first += kBlockRows) {
    const int count = HWY_MIN(job.num_rows - first, kBlockRows);
    PackRows<Product>(job.rows + int64_t{first} * kDescriptorBytes, count, packed);
    Clear(row_states, kBlockRows);
    BlockDots<Product>(job, first, reinterpret_cast<const int32_t*>(packed), row_states);
    for (int i = 0; i < count; ++i) {
      NearestDots nearest = LaneOf(row_states + i * kStateSize, 0);
      for (int lane = 1; lane < kLanes; ++lane) {
        nearest = Merge(nearest, LaneOf(row_states + i * kStateSize, lane));
      }
      job.of_row[first + i] = nearest;
    }
  }
  for (int32_t column = 0; column < job.num_columns; ++column) {
    job.of_column[column] =
        LaneOf(job.column_states + column / kLanes * kStateSize, column % kLanes);
  }
}

}  // namespace

void NearestDescriptors(const MatchJob& job) { FindNearest<Words>(job); }
#if HWY_TARGET == HWY_AVX3
void NearestDescriptorsVnni(const MatchJob& job) { FindNearest<Bytes>(job); }
#endif

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
