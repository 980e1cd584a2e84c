#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/dataset/dataset_index.h"
#include "core/dataset/pixel_frame.h"

namespace pepeseg {

// The files that belong to photographs, by what they hold. One tool has made all of a kind.
enum class Companion { kMasks, kIgnore, kDepth };

// Notes of what was changed or left out while views were read: names of files. Each of several
// threads that read has its own.
struct ReadingNotes {
  std::set<std::string> without_depth;  // depth maps without information
  std::set<std::string> soft;           // label images of one mask with soft borders
  std::set<std::string> with_void;      // label images with void borders
  std::map<std::pair<Companion, PixelFrame>, std::set<std::string>> of_turned_photos;
  int num_resized = 0;           // photographs whose cameras were scaled to fit
  std::set<std::string> turned;  // photographs turned by their EXIF orientation

  // Adds what another reader noted.
  void Merge(ReadingNotes other);
  // Adds a warning for each kind of note.
  void AddWarnings(std::vector<std::string>& warnings) const;
};

}  // namespace pepeseg
