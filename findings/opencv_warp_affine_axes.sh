#!/usr/bin/env bash
# OpenCV's warpAffine treats x and y differently: warping a transposed picture is not the transposed warp.
#
# OpenCV 4.6.0 as packaged by Debian 12. One would expect that a matrix which scales both axes alike and
# shifts them alike gives the same picture with rows and columns exchanged. Seen, with INTER_LINEAR,
# WARP_INVERSE_MAP and a picture of floats, scale 0.3703, shift 0.2105:
#   - some values differ. Source coordinates are integers of 1/1024 pixel: x is the sum of two rounded
#     numbers, of scale * x and of the shift; y is the rounded sum. The result is cut to 1/32 pixel.
#   - where scale and shift are multiples of 1/1024, both agree.
# So code that must give OpenCV's pixels, as on another device, needs both rules.
#
# Needs Debian 12's apt, g++ and about 20 MB. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
version=4.6.0+dfsg-12
apt-get download -qq libopencv-core406=$version libopencv-imgproc406=$version libopencv-core-dev=$version \
  libopencv-imgproc-dev=$version libtbb12 liblapack3 libblas3 libgfortran5 libquadmath0
for package in *.deb; do dpkg-deb -x "$package" .; done
libraries=$(dirname "$(find "$folder/usr/lib" -name 'libopencv_core.so.406')")

cat > warp.cc <<'SOURCE'
#include <cstdio>
#include <opencv2/imgproc.hpp>

// Returns the number of values in which the warp of the transposed picture differs.
static int NumDifferent(const cv::Mat& picture, double scale, double shift) {
  const cv::Mat matrix = (cv::Mat_<double>(2, 3) << scale, 0, shift, 0, scale, shift);
  const int flags = cv::INTER_LINEAR | cv::WARP_INVERSE_MAP;
  cv::Mat upright, lying;
  cv::warpAffine(picture, upright, matrix, {200, 200}, flags);
  cv::warpAffine(picture.t(), lying, matrix, {200, 200}, flags);
  // More than the last bits, in which the order of sums has a part.
  return cv::countNonZero(cv::abs(upright - lying.t()) > 1e-3);
}

int main() {
  cv::Mat picture(100, 100, CV_32F);
  cv::RNG random(1);
  random.fill(picture, cv::RNG::UNIFORM, 0, 1);
  const int odd = NumDifferent(picture, 0.3703, 0.2105);
  const int exact = NumDifferent(picture, 379 / 1024.0, 215 / 1024.0);
  std::printf("OpenCV %s: %d of 40000 values differ; with multiples of 1/1024: %d\n", CV_VERSION, odd, exact);
  return odd > 0 && exact == 0 ? 0 : 1;
}
SOURCE
g++ -O1 -I usr/include/opencv4 -I usr/include/x86_64-linux-gnu/opencv4 warp.cc -o warp \
  -L"$libraries" -Wl,-rpath-link,"$libraries:$libraries/lapack:$libraries/blas" -l:libopencv_imgproc.so.406 -l:libopencv_core.so.406
LD_LIBRARY_PATH=$libraries:$libraries/lapack:$libraries/blas ./warp
