#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace pepeseg::testing {

// The content of COLMAP's three files, and writers of both formats.
struct CameraRecord {
  uint32_t id = 1;
  int model = 1;
  std::string model_name = "PINHOLE";
  uint64_t width = 0, height = 0;
  std::vector<double> parameters;
};
struct ImageRecord {
  uint32_t id = 1;
  double q[4] = {1, 0, 0, 0};
  double t[3] = {0, 0, 0};
  uint32_t camera_id = 1;
  std::string name;
  int num_points = 0;  // number of 2D points; their positions are made up
};
struct PointRecord {
  uint64_t id = 1;
  double xyz[3] = {0, 0, 0};
  uint8_t rgb[3] = {0, 0, 0};
  int track_length = 0;
};

std::string CamerasBinary(const std::vector<CameraRecord>& cameras);
std::string CamerasText(const std::vector<CameraRecord>& cameras);
std::string ImagesBinary(const std::vector<ImageRecord>& images);
std::string ImagesText(const std::vector<ImageRecord>& images);
std::string PointsBinary(const std::vector<PointRecord>& points);
std::string PointsText(const std::vector<PointRecord>& points);

}  // namespace pepeseg::testing
