#include "fdi_lio/mapping/cloud_file.hpp"

#include <array>
#include <cstdio>
#include <fstream>
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

std::string map_header(std::size_t count, CloudFormat format) {
  std::ostringstream out;
  if (format == CloudFormat::kPly) {
    out << "ply\nformat binary_little_endian 1.0\nelement vertex " << count
        << "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\nend_header\n";
  } else {
    out << "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 "
           "4\nTYPE F F F F\n"
        << "COUNT 1 1 1 1\nWIDTH " << count << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " << count
        << "\nDATA binary\n";
  }
  return out.str();
}

}  // namespace

CloudFormat to_cloud_format(const std::string& text) {
  for (const CloudFormat format : {CloudFormat::kPcd, CloudFormat::kPly})
    if (text == to_text(format)) return format;
  throw Error("the format '" + text + "' is not known: choose pcd or ply");
}

const char* to_text(CloudFormat format) { return format == CloudFormat::kPly ? "ply" : "pcd"; }

void write_cloud(const std::string& path, const std::vector<Point>& points, CloudFormat format) {
  const std::string temporary = path + ".part";
  std::ofstream out(temporary, std::ios::binary);
  out << map_header(points.size(), format);
  for (const Point& point : points) {
    const std::array<float, 4> record = {point.position.x(), point.position.y(), point.position.z(),
                                         point.intensity};
    out.write(reinterpret_cast<const char*>(record.data()), sizeof(record));
  }
  out.close();
  if (!out || std::rename(temporary.c_str(), path.c_str()) != 0) {
    std::remove(temporary.c_str());
    throw Error("cannot write the map " + path +
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
