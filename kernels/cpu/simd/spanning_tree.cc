#include "kernels/cpu/simd/kernels.h"
#include "kernels/cpu/simd/lanes.h"
#include "kernels/math/reach.h"

namespace pepeseg {
namespace HWY_NAMESPACE {
namespace {

// Distances of the spanning tree, in tiles of some rows and the columns of a vector or two.
// Channels are added one by one in their order, so that every distance has the same bits wherever
// it is computed.

// The distances of a tile are held in registers: 8 rows x 1 vector with 32 registers (AVX-512), 4 x
// 2 with 16.
constexpr int kTileRows = kLanes == 16 ? 8 : 4;
constexpr int kTileVectors = kLanes == 16 ? 1 : 2;
constexpr int kTileColumns = kTileVectors * kLanes;
static_assert(kTreeRows % kTileRows == 0 && kTreeColumns % kTileColumns == 0);

struct Tile {
  Lanes squared[kTileRows][kTileVectors];
};

// Computes the squared distances of a tile. `columns` is at channel 0 of the first column.
PEPESEG_HD void SquaredDistances(const float* rows, const float* columns, Tile& tile) {
  HWY_UNROLL(kTileRows)
  for (int i = 0; i < kTileRows; ++i) {
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) tile.squared[i][v] = Lanes(0.0f);
  }
  for (int channel = 0; channel < kFeatureSize; ++channel) {
    Lanes column[kTileVectors];
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) {
      column[v] = Lanes::Load(columns + channel * kTreeColumns + v * kLanes);
    }
    HWY_UNROLL(kTileRows)
    for (int i = 0; i < kTileRows; ++i) {
      const Lanes row(rows[i * kFeatureSize + channel]);
      HWY_UNROLL(kTileVectors)
      for (int v = 0; v < kTileVectors; ++v) {
        tile.squared[i][v] = AddSquare(column[v], row, tile.squared[i][v]);
      }
    }
  }
}

// State of the search for kNearestRows rows. The lists themselves are in NearestJob::nearest.
struct Lists {
  float farthest[kNearestRows];  // squared distance of the last one in each list
  int32_t first_row, num_rows;
};

// Inserts a candidate, which is nearer than the last of the list, and drops the last. Behind equal
// ones, so that the lower point, which is offered first, comes first.
PEPESEG_HD void Insert(Neighbour candidate, int count, Neighbour* list) {
  int place = count - 1;
  for (; place > 0 && list[place - 1].squared > candidate.squared; --place) {
    list[place] = list[place - 1];
  }
  list[place] = candidate;
}

// Offers the distances of one row to the kLanes points from `first` on. Skips the point itself and
// padding.
PEPESEG_HD void Offer(const NearestJob& job, Lanes squared, int32_t first, int row, Lists& lists) {
  uint32_t nearer = BitsOf(squared < Lanes(lists.farthest[row]));
  if (nearer == 0) return;
  float values[kLanes];
  squared.Store(values);
  const int32_t point = lists.first_row + row;
  Neighbour* list = job.nearest + int64_t{point} * job.num_nearest;
  for (; nearer != 0; nearer &= nearer - 1) {
    const int lane = __builtin_ctz(nearer);
    const int32_t other = first + lane;
    if (other == point || other >= job.num_points || !(values[lane] < lists.farthest[row])) {
      continue;
    }
    Insert({values[lane], other}, job.num_nearest, list);
    lists.farthest[row] = list[job.num_nearest - 1].squared;
  }
}

// The least edges of kTileColumns columns to the tree.
struct Reach {
  Lanes squared[kTileVectors];
  hn::Vec<IntTag> from[kTileVectors];
};
// Replaces them where an edge to one of the tile's rows comes first.
PEPESEG_HD void RelaxTile(const RelaxJob& job, const Tile& tile, int first_row, const Lanes* core,
                          Reach& reach) {
  const FloatTag d;
  const IntTag di;
  HWY_UNROLL(kTileRows)
  for (int i = 0; i < kTileRows; ++i) {
    const Lanes row_core(job.row_core[first_row + i]);
    const auto point = hn::Set(di, job.row_points[first_row + i]);
    HWY_UNROLL(kTileVectors)
    for (int v = 0; v < kTileVectors; ++v) {
      const Lanes squared = MutualReach(tile.squared[i][v], core[v], row_core);
      // The edge to the lower point comes first of two equal ones from one column.
      const auto lower = hn::RebindMask(d, hn::Lt(point, reach.from[v]));
      const auto same = hn::Eq(squared.v, reach.squared[v].v);
      const auto nearer = hn::Or(hn::Lt(squared.v, reach.squared[v].v), hn::And(same, lower));
      reach.squared[v] = Lanes(hn::IfThenElse(nearer, squared.v, reach.squared[v].v));
      reach.from[v] = hn::IfThenElse(hn::RebindMask(di, nearer), point, reach.from[v]);
    }
  }
}

}  // namespace

// Compares kNearestRows points with all points. Each group of columns is read once for all rows.
void NearestNeighbours(const NearestJob& job, FeatureRange range) {
  alignas(64) float rows[kNearestRows * kFeatureSize];
  Lists lists = {{}, static_cast<int32_t>(range.first), static_cast<int>(range.end - range.first)};
  for (int row = 0; row < kNearestRows; ++row) {
    // Rows after the last one repeat it. Their distance limit of -1 keeps them from being offered.
    const int64_t point = Min(range.first + row, range.end - 1);
    StoreFeature(LoadFeature(job.points + point * kFeatureSize), rows + row * kFeatureSize);
    lists.farthest[row] = row < lists.num_rows ? INFINITY : -1.0f;
    if (row >= lists.num_rows) continue;
    for (int i = 0; i < job.num_nearest; ++i) {
      job.nearest[point * job.num_nearest + i] = {INFINITY, -1};
    }
  }
  for (int32_t group = 0; group < job.num_points; group += kTreeColumns) {
    const float* columns = job.columns + int64_t{group} * kFeatureSize;
    for (int row = 0; row < kNearestRows; row += kTileRows) {
      for (int first = 0; first < kTreeColumns; first += kTileColumns) {
        Tile tile;
        SquaredDistances(rows + row * kFeatureSize, columns + first, tile);
        HWY_UNROLL(kTileRows)
        for (int i = 0; i < kTileRows; ++i) {
          HWY_UNROLL(kTileVectors)
          for (int v = 0; v < kTileVectors; ++v) {
            Offer(job, tile.squared[i][v], group + first + v * kLanes, row + i, lists);
          }
        }
      }
    }
  }
}

// Columns are the outer loop: their state stays in registers over all rows.
void RelaxColumns(const RelaxJob& job, ColumnRange range) {
  const IntTag di;
  for (int32_t first = range.first; first < range.end; first += kTileColumns) {
    const int64_t group = first / kTreeColumns;
    const float* columns = job.columns + group * kTreeColumns * kFeatureSize + first % kTreeColumns;
    Reach reach;
    Lanes core[kTileVectors];
    for (int v = 0; v < kTileVectors; ++v) {
      core[v] = Lanes::Load(job.core + first + v * kLanes);
      reach.squared[v] = Lanes::Load(job.reach + first + v * kLanes);
      reach.from[v] = hn::LoadU(di, job.from + first + v * kLanes);
    }
    for (int row = 0; row < job.num_rows; row += kTileRows) {
      Tile tile;
      SquaredDistances(job.rows + int64_t{row} * kFeatureSize, columns, tile);
      RelaxTile(job, tile, row, core, reach);
    }
    for (int v = 0; v < kTileVectors; ++v) {
      reach.squared[v].Store(job.reach + first + v * kLanes);
      hn::StoreU(reach.from[v], di, job.from + first + v * kLanes);
    }
  }
}

float LeastOf(const float* values, int32_t padded) {
  Lanes least(INFINITY);
  for (int32_t i = 0; i < padded; i += kLanes) least = Min(least, Lanes::Load(values + i));
  return hn::GetLane(hn::MinOfLanes(FloatTag(), least.v));
}

}  // namespace HWY_NAMESPACE
}  // namespace pepeseg
