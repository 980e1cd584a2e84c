#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/find/scene_segments.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

// A thing that a detector or a program sees in the photograph of a view: a box, or a mask.
struct Sighting {
  int word = 0;                          // what it is, a number from 0
  float score = 0;                       // (0, 1]
  float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // box, shares of the view's width and height, [0, 1]
  BinaryMask mask = {};                  // [mask_height, mask_width] over the view; empty: a box
  int mask_width = 0, mask_height = 0;
};

// The word of a segment.
struct SegmentWord {
  int32_t segment = 0;  // its number
  int word = 0;
  double score = 0;  // (0, 1]
};

// Lowest IoU with which a sighting fits what a view shows of a segment, and fewest pixels of the
// view's grid that show a segment well enough to be recognised.
inline constexpr double kSightingFits = 0.5;
inline constexpr int32_t kSightedPixels = 20;

// Returns the word that the views see most in each segment, best score first; segments that fit no
// sighting have none (METHOD.md section 4, "Words").
//
// In a view that shows the segment, a word gets the score of its best fitting sighting times the
// IoU of the two: of their boxes, or of a mask and the segment's pixels. Its score for the segment
// is the mean over the better half of these views, at least two: the others show the thing half
// hidden, from behind or cut off. A box fits no piece. A segment has one word, since a network
// gives a thing the scores of several words that it might be.
//
// sightings: of each view of the scene, in its order, with words below `num_words`.
std::vector<SegmentWord> VoteWords(const SceneSegments& scene,
                                   std::span<const std::vector<Sighting>> sightings, int num_words);

// Returns the segments of a word, best score first. Of segments that lie in each other only the
// best is a thing; of equal ones, the one with more Gaussians.
std::vector<SegmentWord> ThingsOfWord(const SceneSegments& scene,
                                      std::span<const SegmentWord> words, int word);

}  // namespace pepeseg
