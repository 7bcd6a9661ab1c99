// Base colours of the surface: sRGB of its vertices, and images that they are multiplied with.

const AS_STORED = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

async function baseColours(about, columns) {
  if (!about) return null;
  const images = about.wraps.map(async (wrap, number) => ({
    wrap,
    bitmap: await createImageBitmap(new Blob([columns[`image${number}`]]), AS_STORED),
  }));
  return { colours: columns.base, uv: columns.baseUv && coordinates(columns.baseUv, about), images: await Promise.all(images) };
}
