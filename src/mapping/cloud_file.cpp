#include "fdi_lio/mapping/cloud_file.hpp"

#include <array>
#include <cstdio>
#include <limits>
#include <sstream>
#include <vector>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::mapping {

namespace {

using Record = std::array<float, 5>;  ///< x y z intensity layer

std::string header(std::size_t count) {
  std::ostringstream out;
  out << "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity layer\n"
      << "SIZE 4 4 4 4 4\nTYPE F F F F F\nCOUNT 1 1 1 1 1\nWIDTH " << count
      << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << count << "\nDATA binary\n";
  return out.str();
}

std::string map_header(std::size_t count, CloudFormat format, std::size_t padding) {
  const std::string spaces(padding, ' ');
  std::ostringstream out;
  if (format == CloudFormat::kPly) {
    out << "ply\nformat binary_little_endian 1.0\ncomment fdi_lio" << spaces << "\nelement vertex " << count
        << "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\nend_header\n";
  } else {
    out << "# .PCD v0.7 - Point Cloud Data file format" << spaces
        << "\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\n"
        << "COUNT 1 1 1 1\nWIDTH " << count << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << count
        << "\nDATA binary\n";
  }
  return out.str();
}

/// A header as long as that of any other number of points: spaces in a comment fill it up.
std::string map_header(std::size_t count, CloudFormat format) {
  const std::size_t longest = map_header(std::numeric_limits<std::size_t>::max(), format, 0).size();
  return map_header(count, format, longest - map_header(count, format, 0).size());
}

}  // namespace

CloudFormat to_cloud_format(const std::string& text) {
  for (const CloudFormat format : {CloudFormat::kPcd, CloudFormat::kPly})
    if (text == to_text(format)) return format;
  throw Error("the format '" + text + "' is not known: choose pcd or ply");
}

const char* to_text(CloudFormat format) { return format == CloudFormat::kPly ? "ply" : "pcd"; }

CloudFile::CloudFile(const std::string& path, CloudFormat format)
    : path_(path), temporary_(path + ".part"), format_(format), out_(temporary_, std::ios::binary) {
  out_ << map_header(0, format_);
}

CloudFile::~CloudFile() {
  if (!out_.is_open()) return;
  out_.close();
  std::remove(temporary_.c_str());
}

void CloudFile::add(const Point& point) {
  const std::array<float, 4> record = {point.position.x(), point.position.y(), point.position.z(),
                                       point.intensity};
  out_.write(reinterpret_cast<const char*>(record.data()), sizeof(record));
  ++count_;
}

void CloudFile::close() {
  out_.seekp(0);
  out_ << map_header(count_, format_);
  out_.close();
  if (!out_ || std::rename(temporary_.c_str(), path_.c_str()) != 0) {
    std::remove(temporary_.c_str());
    throw Error("cannot write the map " + path_ +
                ": check free space and permission; an earlier file was left as it was");
  }
}

void write_keyframe_pcd(const std::string& path, const KeyframeCloud& cloud) {
  std::vector<Record> records;
  records.reserve(cloud.size());
  float layer = 0.0F;
  for (const auto* points : {&cloud.surface, &cloud.planes, &cloud.edges}) {
    for (const Point& p : *points)
      records.push_back({p.position.x(), p.position.y(), p.position.z(), p.intensity, layer});
    layer += 1.0F;
  }
  std::ofstream out(path, std::ios::binary);
  out << header(records.size());
  out.write(reinterpret_cast<const char*>(records.data()),
            static_cast<std::streamsize>(records.size() * sizeof(Record)));
  out.close();
  if (!out) throw Error("cannot write " + path + ": check free space and permission");
}

KeyframeCloud read_keyframe_pcd(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string text;
  std::size_t count = 0;
  for (std::string line; text.size() < 1000 && std::getline(in, line);) {
    text += line + "\n";
    if (line.rfind("POINTS ", 0) == 0) count = std::strtoull(line.c_str() + 7, nullptr, 10);
    if (line.rfind("DATA ", 0) == 0) break;
  }
  if (!in || text != header(count)) throw Error(path + " is no keyframe cloud of this program");
  KeyframeCloud cloud;
  std::vector<Point>* const layers[] = {&cloud.surface, &cloud.planes, &cloud.edges};
  Record record;
  for (std::size_t k = 0; k < count; ++k) {
    if (!in.read(reinterpret_cast<char*>(record.data()), sizeof(Record)))
      throw Error(path + " is cut short: " + std::to_string(k) + " of " + std::to_string(count) + " points");
    Point point;
    point.position = Eigen::Vector3f(record[0], record[1], record[2]);
    point.intensity = record[3];
    if (!(record[4] >= 0.0F && record[4] < 3.0F)) throw Error(path + " has a point of an unknown layer");
    layers[static_cast<int>(record[4])]->push_back(point);
  }
  return cloud;
}

}  // namespace fdi_lio::mapping
