#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

// Which pairs of photographs are compared in full. Small captures: all. Larger ones: pairs that
// score well by a few features (PairScores), and more of them where verification leaves the
// photographs in several groups, or hanging together by one pair.
namespace pepeseg {

// Two different photographs by their indices, first < second.
struct PhotographPair {
  size_t first = 0, second = 0;

  auto operator<=>(const PhotographPair&) const = default;
};
// Returns the pair of two different photographs, in either order.
PhotographPair PairOf(size_t one, size_t other);

// Scores of all pairs of n photographs; the higher, the more they seem to have in common.
class PairScores {
 public:
  explicit PairScores(size_t num_photographs)
      : num_photographs_(num_photographs), scores_(num_photographs * num_photographs) {}

  size_t num_photographs() const { return num_photographs_; }
  int64_t Get(size_t one, size_t other) const { return scores_[one * num_photographs_ + other]; }
  void Add(size_t one, size_t other, int64_t score);

 private:
  size_t num_photographs_;
  std::vector<int64_t> scores_;  // symmetric
};

// Returns all pairs, ordered by the second photograph, then the first.
std::vector<PhotographPair> AllPairs(size_t num_photographs);

// Returns the pairs of photographs in a row that are at most `overlap` apart and, with `powers`, at
// distances that are powers of two (COLMAP's quadratic overlap).
std::vector<PhotographPair> NeighborPairs(size_t num_photographs, size_t overlap, bool powers);

// The groups of photographs that verified pairs connect.
struct PhotographGroups {
  std::vector<size_t> group;  // of each photograph, numbered from 0
  size_t num_groups = 0;
  std::vector<PhotographPair> bridges;  // pairs without which a group would fall apart
};
PhotographGroups GroupsOf(size_t num_photographs, const std::vector<PhotographPair>& verified);

// Hands out pairs, each once, best scores first.
class PairSelection {
 public:
  explicit PairSelection(PairScores scores);

  // Marks pairs as handed out.
  void Skip(const std::vector<PhotographPair>& pairs);
  // Returns the next `count` best pairs of each photograph that scored above 0, ordered as
  // AllPairs. Pairs that were handed out before are not counted.
  std::vector<PhotographPair> Next(size_t count);
  // Returns the next `count` best pairs of each photograph that is outside the largest group or at
  // a bridge. Returns nothing if no photograph is there, or all of their pairs were handed out.
  std::vector<PhotographPair> NextAtCuts(const PhotographGroups& groups, size_t count);

 private:
  std::vector<PhotographPair> NextOf(const std::vector<size_t>& photographs, size_t count);

  size_t num_photographs_;
  // For each photograph: the other photographs, best score first, and the first of them that has
  // not been looked at.
  std::vector<std::vector<size_t>> ranked_;
  std::vector<size_t> next_;
  std::set<PhotographPair> taken_;
};

}  // namespace pepeseg
