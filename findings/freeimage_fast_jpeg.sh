#!/usr/bin/env bash
# FreeImage, with which COLMAP 3.8 reads photographs, decodes a JPEG to other pixels than most programs.
#
# FreeImage 3.18.0 as packaged by Debian 12, with libjpeg-turbo 2.1.5. One would expect the pixels that
# OpenCV, Pillow or djpeg get from the same libjpeg. Seen, by FreeImage_Load with flags 0:
#   - the pixels are those of `djpeg -dct fast -nosmooth`, byte for byte: the fast DCT, and colour that is
#     repeated and not interpolated. Those of plain djpeg differ in most pixels.
#   - with JPEG_ACCURATE (2) they are those of plain djpeg. COLMAP does not ask for it.
#   - FreeImage_ConvertToGreyscale weighs by Rec. 709 (0.2126, 0.7152, 0.0722), not by Rec. 601 as libjpeg,
#     OpenCV and Pillow do: pure red has grey 54, not 76.
# So SIFT features by another decoder are not those of COLMAP, though the detector is the same.
#
# Needs Debian 12's apt and python3, and about 10 MB. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq libfreeimage3=3.18.0+ds2-9+deb12u1 libjpeg-turbo-progs=1:2.1.5-2 \
  libjpeg62-turbo=1:2.1.5-2 libturbojpeg0 libimath-3-1-29 libjxr0 libopenexr-3-1-30 libopenjp2-7 \
  libraw20 libtiff6 libwebp7 libwebpmux3 libpng16-16 liblcms2-2 libgomp1 libdeflate0 libjbig0 \
  liblerc4 libzstd1 liblzma5 zlib1g
for package in *.deb; do dpkg-deb -x "$package" .; done
libraries=$(dirname "$(find "$folder/usr/lib" -name 'libfreeimage.so.3')")
export LD_LIBRARY_PATH=$libraries PATH=$folder/usr/bin:$PATH

# A picture with texture and colour, and one that is red.
python3 - <<'SOURCE'
import random

random.seed(1)
width, height = 160, 120


def write(name, pixel):
    with open(name, "wb") as file:
        file.write(b"P6 %d %d 255\n" % (width, height))
        file.write(bytes(value for y in range(height) for x in range(width) for value in pixel(x, y)))


write("texture.ppm", lambda x, y: [min(255, (x * 7 + y * 3) % 200 + random.randrange(56)),
                                   (x * y // 9) % 256, (255 - x - y) % 256])
write("red.ppm", lambda x, y: [255, 0, 0])
SOURCE
for name in texture red; do cjpeg -quality 90 "$name.ppm" >"$name.jpg"; done
djpeg texture.jpg >plain.ppm
djpeg -nosmooth texture.jpg >nosmooth.ppm
djpeg -dct fast -nosmooth texture.jpg >fast.ppm

cat > behaviour.py <<'SOURCE'
import ctypes
import os
import sys

free_image = ctypes.CDLL(os.path.join(sys.argv[1], "libfreeimage.so.3"))
free_image.FreeImage_GetVersion.restype = ctypes.c_char_p
for name in ("Load", "ConvertToGreyscale", "GetScanLine"):
    getattr(free_image, "FreeImage_" + name).restype = ctypes.c_void_p
for name in ("ConvertToGreyscale", "GetWidth", "GetHeight"):
    getattr(free_image, "FreeImage_" + name).argtypes = [ctypes.c_void_p]
free_image.FreeImage_GetScanLine.argtypes = [ctypes.c_void_p, ctypes.c_int]
FIF_JPEG = 2


def load(name, flags):
    bitmap = free_image.FreeImage_Load(FIF_JPEG, name.encode(), flags)
    assert bitmap, name
    return bitmap


def rows(bitmap, channels):
    """Returns the bytes of the scanlines, from the top; FreeImage counts them from below."""
    width = free_image.FreeImage_GetWidth(bitmap)
    height = free_image.FreeImage_GetHeight(bitmap)
    return [ctypes.string_at(free_image.FreeImage_GetScanLine(bitmap, height - 1 - y), width * channels)
            for y in range(height)]


def rgb(name, flags):
    return b"".join(bytes(row[x + c] for x in range(0, len(row), 3) for c in (2, 1, 0))
                    for row in rows(load(name, flags), 3))


def ppm(name):
    with open(name, "rb") as file:
        return file.read().split(b"255\n", 1)[1]


def share(one, other):
    pixels = range(0, len(one), 3)
    return sum(one[i:i + 3] == other[i:i + 3] for i in pixels) / len(pixels)


print("FreeImage", free_image.FreeImage_GetVersion().decode())
loaded, accurate = rgb("texture.jpg", 0), rgb("texture.jpg", 2)
for flags, pixels in ((0, loaded), (2, accurate)):
    for name in ("plain", "nosmooth", "fast"):
        print(f"flags {flags}: {100 * share(pixels, ppm(name + '.ppm')):.1f} % of the pixels are those of {name}")
grey = rows(free_image.FreeImage_ConvertToGreyscale(load("red.jpg", 0)), 1)[0][0]
print("red becomes grey", grey)
assert loaded == ppm("fast.ppm") and accurate == ppm("plain.ppm")
assert share(loaded, ppm("plain.ppm")) < 0.5
assert 53 <= grey <= 55
SOURCE
python3 behaviour.py "$libraries"
