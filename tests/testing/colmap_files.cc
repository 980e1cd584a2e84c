#include "tests/testing/colmap_files.h"

#include <iomanip>
#include <limits>
#include <sstream>

namespace pepeseg::testing {
namespace {

class Bytes {
 public:
  template <class T>
  Bytes& Put(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  Bytes& PutString(const std::string& text) {
    bytes_.append(text).push_back('\0');
    return *this;
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

std::ostringstream TextStream() {
  std::ostringstream text;
  text << std::setprecision(std::numeric_limits<double>::max_digits10);
  text << "# written by a test\n";
  return text;
}

}  // namespace

std::string CamerasBinary(const std::vector<CameraRecord>& cameras) {
  Bytes bytes;
  bytes.Put<uint64_t>(cameras.size());
  for (const CameraRecord& camera : cameras) {
    bytes.Put(camera.id).Put<int32_t>(camera.model).Put(camera.width).Put(camera.height);
    for (const double parameter : camera.parameters) bytes.Put(parameter);
  }
  return bytes.Take();
}

std::string CamerasText(const std::vector<CameraRecord>& cameras) {
  std::ostringstream text = TextStream();
  for (const CameraRecord& camera : cameras) {
    text << camera.id << " " << camera.model_name << " " << camera.width << " " << camera.height;
    for (const double parameter : camera.parameters) text << " " << parameter;
    text << "\n";
  }
  return text.str();
}

std::string ImagesBinary(const std::vector<ImageRecord>& images) {
  Bytes bytes;
  bytes.Put<uint64_t>(images.size());
  for (const ImageRecord& image : images) {
    bytes.Put(image.id);
    for (const double q : image.q) bytes.Put(q);
    for (const double t : image.t) bytes.Put(t);
    bytes.Put(image.camera_id).PutString(image.name).Put<uint64_t>(image.num_points);
    for (int i = 0; i < image.num_points; ++i) {
      bytes.Put<double>(i).Put<double>(2 * i).Put<uint64_t>(i % 2 == 0 ? 7 : ~uint64_t{0});
    }
  }
  return bytes.Take();
}

std::string ImagesText(const std::vector<ImageRecord>& images) {
  std::ostringstream text = TextStream();
  for (const ImageRecord& image : images) {
    text << image.id;
    for (const double q : image.q) text << " " << q;
    for (const double t : image.t) text << " " << t;
    text << " " << image.camera_id << " " << image.name << "\n";
    for (int i = 0; i < image.num_points; ++i) {
      text << (i == 0 ? "" : " ") << i << " " << 2 * i << " " << (i % 2 == 0 ? "7" : "-1");
    }
    text << "\n";
  }
  return text.str();
}

std::string PointsBinary(const std::vector<PointRecord>& points) {
  Bytes bytes;
  bytes.Put<uint64_t>(points.size());
  for (const PointRecord& point : points) {
    bytes.Put(point.id);
    for (const double x : point.xyz) bytes.Put(x);
    for (const uint8_t c : point.rgb) bytes.Put(c);
    bytes.Put(0.5).Put<uint64_t>(point.track_length);
    for (int i = 0; i < point.track_length; ++i) bytes.Put<uint32_t>(1).Put<uint32_t>(i);
  }
  return bytes.Take();
}

std::string PointsText(const std::vector<PointRecord>& points) {
  std::ostringstream text = TextStream();
  for (const PointRecord& point : points) {
    text << point.id;
    for (const double x : point.xyz) text << " " << x;
    for (const uint8_t c : point.rgb) text << " " << static_cast<int>(c);
    text << " 0.5";
    for (int i = 0; i < point.track_length; ++i) text << " 1 " << i;
    text << "\n";
  }
  return text.str();
}

}  // namespace pepeseg::testing
