#include <algorithm>
#include <cassert>
#include <vector>

#include "kernels/cpu/cpu_backend.h"

namespace pepeseg {
namespace {

// The rows of one group, and where its columns and entries are written.
struct Group {
  int64_t first_row, end_row;
  int64_t first_column, first_entry;
};

// The arrays that are written, see ColumnSpan.
struct Columns {
  int32_t *gaussian, *first, *pixel;
  float* weight;  // null: the rows have none
};

// Sets counts[gaussian] to the number of entries; returns the number of Gaussians with an entry.
int64_t CountEntries(const RowSpan& rows, const Group& group, std::vector<int32_t>& counts) {
  std::fill(counts.begin(), counts.end(), 0);
  for (int32_t e = rows.first[group.first_row]; e < rows.first[group.end_row]; ++e) {
    ++counts[rows.gaussian[e]];
  }
  return static_cast<int64_t>(counts.size()) - std::count(counts.begin(), counts.end(), 0);
}

// Counting sort by Gaussian; stable, so pixels stay ascending. `next` holds the counts, and is used
// for the next free place of each Gaussian.
void SortEntries(const RowSpan& rows, const Group& group, std::vector<int32_t>& next,
                 const Columns& out) {
  auto place = static_cast<int32_t>(group.first_entry);
  int64_t column = group.first_column;
  for (size_t gaussian = 0; gaussian < next.size(); ++gaussian) {
    const int32_t count = next[gaussian];
    if (count == 0) continue;
    out.gaussian[column] = static_cast<int32_t>(gaussian);
    out.first[column++] = place;
    next[gaussian] = place;
    place += count;
  }
  for (int64_t row = group.first_row; row < group.end_row; ++row) {
    for (int32_t e = rows.first[row]; e < rows.first[row + 1]; ++e) {
      const int32_t to = next[rows.gaussian[e]]++;
      out.pixel[to] = static_cast<int32_t>(row - group.first_row);
      if (out.weight != nullptr) out.weight[to] = rows.weight[e];
    }
  }
}

// The row ranges of the groups; columns and entries are still to be set.
std::vector<Group> GroupsOf(const TransposeRowsArgs& args) {
  if (args.group_first.empty()) return {{0, args.rows.first.size - 1, 0, 0}};
  std::vector<Group> groups;
  for (size_t g = 0; g + 1 < args.group_first.size(); ++g) {
    groups.push_back({args.group_first[g], args.group_first[g + 1], 0, 0});
  }
  return groups;
}

}  // namespace

// A task is a group. Groups are counted twice, before and after their sizes are known, rather than
// keeping a count of all Gaussians for each of them.
void CpuBackend::TransposeRows(const TransposeRowsArgs& args) {
  if (failed()) return;
  const RowSpan& rows = args.rows;
  std::vector<Group> groups = GroupsOf(args);
  const auto num_groups = static_cast<int64_t>(groups.size());
  std::vector<std::vector<int32_t>> counts(pool_.num_threads());
  for (std::vector<int32_t>& of_thread : counts) of_thread.resize(args.num_gaussians);
  std::vector<int64_t> num_columns(groups.size());
  pool_.ParallelFor(num_groups, [&](int64_t g, int thread) {
    num_columns[g] = CountEntries(rows, groups[g], counts[thread]);
  });
  // Columns of a group follow those of the group before it.
  int64_t num_touched = 0;
  if (args.group_column != nullptr) args.group_column->clear();
  for (size_t g = 0; g < groups.size(); ++g) {
    groups[g].first_column = num_touched;
    groups[g].first_entry = rows.first[groups[g].first_row] - rows.first[groups[0].first_row];
    if (args.group_column != nullptr) {
      args.group_column->push_back(static_cast<int32_t>(num_touched));
    }
    num_touched += num_columns[g];
  }
  if (args.group_column != nullptr) args.group_column->push_back(static_cast<int32_t>(num_touched));
  const bool weighted = rows.weight.size != 0;
  const int64_t num_entries =
      groups.empty() ? 0 : rows.first[groups.back().end_row] - rows.first[groups[0].first_row];
  if (!args.gaussian->Reserve(*this, num_touched) || !args.first->Reserve(*this, num_touched + 1) ||
      !args.pixel->Reserve(*this, num_entries) ||
      (weighted && !args.weight->Reserve(*this, num_entries))) {
    return;
  }
  const Columns out = {args.gaussian->span().data, args.first->span().data, args.pixel->span().data,
                       weighted ? args.weight->span().data : nullptr};
  assert(out.first != nullptr);
  pool_.ParallelFor(num_groups, [&](int64_t g, int thread) {
    CountEntries(rows, groups[g], counts[thread]);
    SortEntries(rows, groups[g], counts[thread], out);
  });
  out.first[num_touched] = static_cast<int32_t>(num_entries);
}

}  // namespace pepeseg
