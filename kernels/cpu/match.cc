#include "kernels/math/match.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

// Working memory of a thread, which keeps the columns of its last pair.
struct MatchMemory {
  std::vector<int32_t> packed, bias, column_states;
  std::vector<NearestDots> of_row, of_column;
  int32_t packed_block = -1;
};

// A block of descriptors.
struct Block {
  const uint8_t* descriptors;
  int32_t count;
};
Block BlockOf(const MatchDescriptorsArgs& args, int32_t block) {
  const int64_t first = args.block_first[block];
  return {args.descriptors.data + first * kDescriptorBytes,
          static_cast<int32_t>(args.block_first[block + 1] - first)};
}

// Fills of_row and of_column of `memory`.
void FindNearest(const SimdKernels& simd, const MatchDescriptorsArgs& args, BlockPair pair,
                 MatchMemory& memory) {
  const Block rows = BlockOf(args, pair.first), columns = BlockOf(args, pair.second);
  const int64_t padded =
      (columns.count + kMatchPadding - 1) / int64_t{kMatchPadding} * kMatchPadding;
  memory.of_row.resize(rows.count);
  memory.of_column.resize(columns.count);
  memory.packed.resize(padded * kMatchPackedWords);
  memory.bias.resize(padded);
  memory.column_states.resize(3 * padded);
  simd.nearest_descriptors({.rows = rows.descriptors,
                            .num_rows = rows.count,
                            .columns = columns.descriptors,
                            .num_columns = columns.count,
                            .is_packed = memory.packed_block == pair.second,
                            .packed = memory.packed.data(),
                            .bias = memory.bias.data(),
                            .column_states = memory.column_states.data(),
                            .of_row = memory.of_row.data(),
                            .of_column = memory.of_column.data()});
  memory.packed_block = pair.second;
}

std::vector<DescriptorMatch> MatchesOf(const MatchDescriptorsArgs& args,
                                       const MatchMemory& memory) {
  std::vector<DescriptorMatch> matches;
  const int32_t* limits = args.second_limits.data;
  for (size_t row = 0; row < memory.of_row.size(); ++row) {
    const int32_t column = MatchOf(memory.of_row[row], limits);
    if (column < 0) continue;
    if (args.mutual && MatchOf(memory.of_column[column], limits) != static_cast<int32_t>(row)) {
      continue;
    }
    matches.push_back({static_cast<uint32_t>(row), static_cast<uint32_t>(column)});
  }
  return matches;
}

}  // namespace

// A task is a pair.
void CpuBackend::MatchDescriptors(const MatchDescriptorsArgs& args) {
  if (failed()) return;
  std::vector<MatchMemory> memories(pool_.num_threads());
  std::vector<std::vector<DescriptorMatch>> of_pair(args.pairs.size());
  pool_.ParallelFor(static_cast<int64_t>(args.pairs.size()), [&](int64_t i, int thread) {
    FindNearest(simd_, args, args.pairs[i], memories[thread]);
    of_pair[i] = MatchesOf(args, memories[thread]);
  });
  args.pair_first->assign(1, 0);
  args.matches->clear();
  for (const std::vector<DescriptorMatch>& matches : of_pair) {
    args.matches->insert(args.matches->end(), matches.begin(), matches.end());
    args.pair_first->push_back(static_cast<int64_t>(args.matches->size()));
  }
}

}  // namespace pepeseg
