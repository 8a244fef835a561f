// Pens: draw the same marks on a canvas or as the text of an SVG file.
class CanvasPen{
  constructor(ctx,k,paper,ink){this.ctx=ctx;this.k=k;this.named={paper,ink}}
  colour(c){return this.named[c]||c}
  stroke(look){
    const{ctx,k}=this;
    ctx.strokeStyle=this.colour(look.colour);ctx.lineWidth=look.width*k;ctx.lineJoin='round';
    ctx.setLineDash(look.dash?look.dash.split(' ').map(d=>d*k):[]);
  }
  path(points,look){
    const{ctx}=this;let down=false;
    ctx.beginPath();
    for(const p of points){if(!p){down=false;continue}if(down)ctx.lineTo(p[0],p[1]);else ctx.moveTo(p[0],p[1]);down=true}
    this.stroke(look);ctx.stroke();ctx.setLineDash([]);
  }
  area(points,fill,alpha){
    const{ctx}=this;
    ctx.beginPath();points.forEach((p,i)=>i?ctx.lineTo(p[0],p[1]):ctx.moveTo(p[0],p[1]));ctx.closePath();
    ctx.globalAlpha=alpha;ctx.fillStyle=this.colour(fill);ctx.fill();ctx.globalAlpha=1;
  }
  rect(x,y,w,h,fill,alpha){const{ctx}=this;ctx.globalAlpha=alpha;ctx.fillStyle=this.colour(fill);ctx.fillRect(x,y,w,h);ctx.globalAlpha=1}
  circle(x,y,r,fill,line){
    const{ctx}=this;
    ctx.beginPath();ctx.arc(x,y,r,0,2*Math.PI);
    if(fill){ctx.fillStyle=this.colour(fill);ctx.fill()}
    ctx.strokeStyle=this.colour(line);ctx.lineWidth=1.4*this.k;ctx.stroke();
  }
  square(x,y,r,fill,line){
    const{ctx}=this;
    ctx.fillStyle=this.colour(fill);ctx.fillRect(x-r,y-r,2*r,2*r);
    ctx.strokeStyle=this.colour(line);ctx.lineWidth=1.4*this.k;ctx.strokeRect(x-r,y-r,2*r,2*r);
  }
  text(x,y,text,anchor,fill,size){
    const{ctx}=this;
    ctx.font=`${size*this.k}px ${FONT}`;ctx.textAlign=anchor==='middle'?'center':anchor;ctx.textBaseline='alphabetic';
    ctx.fillStyle=this.colour(fill);ctx.fillText(text,x,y);
  }
}
const FONT='system-ui,"Segoe UI",Roboto,"Liberation Sans","DejaVu Sans",Arial,sans-serif';
const escapeText=t=>t.replace(/[&<>"']/g,c=>`&#${c.charCodeAt(0)};`);
class SvgPen{
  constructor(){this.k=1;this.parts=[];this.clips=0}
  colour(c){return c==='paper'?'#ffffff':c==='ink'?'#333333':c}
  n(v){return String(+Math.min(Math.max(v,-2e4),2e4).toFixed(1))}
  points(points){let d='',down=false;for(const p of points){if(!p){down=false;continue}d+=(down?'L':'M')+this.n(p[0])+' '+this.n(p[1]);down=true}return d}
  path(points,look){
    const d=this.points(points);
    if(d)this.parts.push(`<path d="${d}" fill="none" stroke="${this.colour(look.colour)}" stroke-width="${look.width}"${look.dash?` stroke-dasharray="${look.dash}"`:''}/>`);
  }
  area(points,fill,alpha){const d=this.points(points);if(d)this.parts.push(`<path d="${d}Z" fill="${this.colour(fill)}" fill-opacity="${alpha}"/>`)}
  rect(x,y,w,h,fill,alpha){this.parts.push(`<rect x="${this.n(x)}" y="${this.n(y)}" width="${this.n(Math.max(0,w))}" height="${this.n(Math.max(0,h))}" fill="${this.colour(fill)}" fill-opacity="${alpha}"/>`)}
  circle(x,y,r,fill,line){this.parts.push(`<circle cx="${this.n(x)}" cy="${this.n(y)}" r="${r}" fill="${fill?this.colour(fill):'none'}" stroke="${this.colour(line)}" stroke-width="1.4"/>`)}
  square(x,y,r,fill,line){this.parts.push(`<rect x="${this.n(x-r)}" y="${this.n(y-r)}" width="${2*r}" height="${2*r}" fill="${this.colour(fill)}" stroke="${this.colour(line)}" stroke-width="1.4"/>`)}
  text(x,y,text,anchor,fill,size,up){this.parts.push(`<text ${up?`transform="translate(${this.n(x)} ${this.n(y)}) rotate(-90)"`:`x="${this.n(x)}" y="${this.n(y)}"`} text-anchor="${anchor}" font-size="${size}" fill="${this.colour(fill)}">${escapeText(text)}</text>`)}
  clipped(box,inside){
    const id='c'+ ++this.clips;
    this.parts.push(`<clipPath id="${id}"><rect x="${box.left}" y="${box.top}" width="${box.right-box.left}" height="${box.bottom-box.top}"/></clipPath><g clip-path="url(#${id})">`);
    inside();this.parts.push('</g>');
  }
}
