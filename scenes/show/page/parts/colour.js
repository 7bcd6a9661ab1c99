// Base colours of the surface: sRGB and alpha of its vertices, and images that they are multiplied with.

const AS_STORED = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

async function baseColours(about, columns) {
  if (!about) return null;
  const images = about.wraps.map(async (wrap, number) => ({
    wrap,
    bitmap: await createImageBitmap(new Blob([columns[`image${number}`]]), AS_STORED),
  }));
  const uv = columns.baseUv && coordinates(columns.baseUv, about);
  return { colours: columns.base, alpha: columns.alpha, uv, images: await Promise.all(images) };
}
