#include "core/formats/colmap.h"
#include "tests/system/fuzz/fuzz_target.h"
#include "tests/system/fuzz/memory_file.h"

// Each of the three readers gets all inputs, so it also sees the files of the other two.
PEPESEG_FUZZ_TARGET(colmap_binary) {
  static pepeseg::fuzz::MemoryFile file;
  const std::string& path = file.Put(bytes);
  (void)pepeseg::ReadColmapCameras(path, "cameras.bin");
  (void)pepeseg::ReadColmapImages(path, "images.bin");
  (void)pepeseg::ReadColmapPoints(path, "points3D.bin");
}
