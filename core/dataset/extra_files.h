#pragma once

#include <set>
#include <span>
#include <string>

namespace pepeseg {

// Returns those of a dataset's file names that are not the owner's work and are left out:
//   - files that systems and devices add to folders, see IsSystemFile;
//   - the video of a Live Photo, IMG_1.MOV next to IMG_1.HEIC: it lasts three seconds and shows the
//     same as the photograph. Both may be below images/ or videos/.
// `names` are relative, with '/'. Clients leave out the same files, but not all clients are ours.
std::set<std::string> ExtraFiles(std::span<const std::string> names);

}  // namespace pepeseg
