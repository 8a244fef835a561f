// Draws the marks of a panel with a pen, as report/svg/marks.rs does.
const unpack=s=>{
  if(typeof s!=='string')return s;
  const bytes=Uint8Array.from(atob(s.slice(4)),c=>c.charCodeAt(0));
  return new Float32Array(bytes.buffer);
};
// decodes the numbers of curves once
function unpackMark(mark){
  for(const shape of[mark.line,mark.ribbon,mark.points,mark.loop,mark.cells,mark.strips]){
    if(!shape)continue;
    for(const key of['x','y','low','high','values'])if(typeof shape[key]==='string')shape[key]=unpack(shape[key]);
    if(shape.bars){shape.bars.low=unpack(shape.bars.low);shape.bars.high=unpack(shape.bars.high)}
  }
  return mark;
}
const along=x=>x.length===undefined?i=>x.first+x.step*i:i=>x[i];
const countOf=(x,y)=>Math.min(x.length===undefined?x.count:x.length,y.length);
const RADIUS=4;

// a curve reduced to what its pixel columns show: first, lowest, highest, last point of each
// values further outside than half the frame interrupt the curve: the lines to and from them would
// look like a hatched area
function curve(pen,x,y,n,sx,sy,look,box){
  const at=along(x),points=[],far=.5*(box.bottom-box.top);
  let column=NaN,held=null;
  const flush=()=>{if(held){for(const p of held.p)points.push(p);held=null}};
  for(let i=0;i<n;i++){
    const px=sx(at(i)),py=sy(y[i]);
    if(!Number.isFinite(px)||!(py>=box.top-far&&py<=box.bottom+far)){flush();column=NaN;points.push(null);continue}
    const c=Math.floor(px);
    if(c!==column){flush();column=c;held={p:[[px,py]],low:py,high:py}}
    else if(held.p.length<4)held.p.push([px,py]),held.low=Math.min(held.low,py),held.high=Math.max(held.high,py);
    else{
      if(py<held.low){held.low=py;held.p.splice(-1,0,[px,py])}
      else if(py>held.high){held.high=py;held.p.splice(-1,0,[px,py])}
      held.p[held.p.length-1]=[px,py];
    }
  }
  flush();
  pen.path(points,look);
}
function marker(pen,x,y,kind,look){
  const r=RADIUS*pen.k,fill=kind==='ring'||kind==='frame'?'paper':look.colour;
  if(kind==='dot'||kind==='ring')pen.circle(x,y,r,fill,look.colour);
  else if(kind==='square'||kind==='frame')pen.square(x,y,r,fill,look.colour);
  else if(kind==='stroke')pen.path([[x,y-7*pen.k],[x,y+7*pen.k]],{...look,dash:'',width:1.6});
  else for(const s of[-1,1])pen.path([[x-r,y-s*r],[x+r,y+s*r]],{...look,dash:'',width:1.8});
}
function bar(pen,bars,i,x,y,sx,sy,box,look){
  const across=bars.along==='x',scale=across?sx:sy,[from,to]=across?[box.left,box.right]:[box.top,box.bottom];
  const turned=(a,b)=>across?[a,b]:[b,a],other=across?y:x,k=pen.k,line={...look,dash:'',width:Math.max(1.4,look.width)};
  const raw=[scale(bars.low[i]),scale(bars.high[i])];
  const ends=raw.map(v=>Number.isFinite(v)?Math.min(Math.max(v,from),to):(across?from:to));
  pen.path([turned(ends[0],other),turned(ends[1],other)],line);
  ends.forEach((at,n)=>{
    const way=(ends[1]>ends[0])===(n===1)?1:-1;
    if(raw[n]!==at)for(const side of[-4,4])pen.path([turned(at,other),turned(at-6*way*k,other+side*k)],line);
    else pen.path([turned(at,other-4*k),turned(at,other+4*k)],line);
  });
}
const STEPS=[[.5,1],[.7,.75],[.9,.5],[.95,.3],[.99,.15]];
const strength=v=>{for(const[below,s]of STEPS)if(v<below)return s;return 0};
function drawMark(pen,mark,sx,sy,box,look){
  let m;
  if((m=mark.line)||(m=mark.loop))curve(pen,m.x,m.y,countOf(m.x,m.y),sx,sy,look,box);
  else if(m=mark.ribbon){
    const at=along(m.x),n=countOf(m.x,m.low),hold=v=>Math.min(Math.max(v,box.top-9),box.bottom+9),points=[];
    const put=(i,v)=>{const x=sx(at(i)),y=sy(v);if(Number.isFinite(x)&&Number.isFinite(y))points.push([x,hold(y)])};
    for(let i=0;i<n;i++)put(i,m.low[i]);
    for(let i=n-1;i>=0;i--)put(i,m.high[i]);
    pen.area(points,look.colour,look.opacity);
  }else if(m=mark.points)for(let i=0;i<m.x.length;i++){
    const x=sx(m.x[i])+(m.aside||0)*pen.k,y=sy(m.y[i]);
    if(!Number.isFinite(x)||!Number.isFinite(y))continue;
    if(m.bars)bar(pen,m.bars,i,x,y,sx,sy,box,look);
    marker(pen,x,y,m.marker,look);
  }
  else if(m=mark.strips){
    const n=m.x.length,hold=v=>Math.min(Math.max(v,box.left),box.right),edge=i=>hold(sx(m.x[Math.min(i,n-1)]));
    for(let row=0;row*n<m.values.length;row++){
      const a=sy(row-.5),b=sy(row+.5),top=Math.min(a,b),height=Math.abs(b-a);
      if(top>box.bottom||top+height<box.top)continue;
      for(let i=0;i<n;){
        const s=strength(m.values[row*n+i]);
        let to=i+1;
        while(to<n&&strength(m.values[row*n+to])===s)to++;
        if(s)pen.rect(edge(i),top,edge(to)-edge(i),height,look.colour,s);
        i=to;
      }
    }
  }
  else if(m=mark.cells){
    const columns=Math.round(mark.columns);
    m.values.forEach((v,i)=>{
      if(!Number.isFinite(v))return;
      const column=i%columns,row=Math.floor(i/columns),x=sx(column-.46),y=[sy(row-.44),sy(row+.44)];
      pen.rect(x,Math.min(...y),sx(column+.46)-x,Math.abs(y[1]-y[0]),look.colour,.06+.94*Math.min(Math.max(v,0),1));
    });
  }
  else if(m=mark.level){const y=sy(m.at),[a,b]=m.between?m.between.map(sx):[box.left,box.right];pen.path([[a,y],[b,y]],look)}
  else if(m=mark.upright){const x=sx(m.at);pen.path([[x,box.top],[x,box.bottom]],look)}
  else if(m=mark.shade){
    const hold=v=>Math.min(Math.max(Number.isFinite(v)?v:box.left,box.left),box.right),[a,b]=m.between.map(v=>hold(sx(v)));
    pen.rect(a,box.top,b-a,box.bottom-box.top,look.colour,look.opacity);
  }else if((m=mark.ring)||(m=mark.text)){
    const x=sx(m.at[0]),y=sy(m.at[1]),k=pen.k;
    if(x<box.left||x>box.right||y<box.top||y>box.bottom)return;
    // above the ring, because curves leave it sideways
    if(mark.ring){pen.circle(x,y,9*k,null,look.colour);pen.text(x,Math.max(y-14*k,box.top+12*k),m.text,'middle','ink',12.5);return}
    const end=x+6.6*k*m.text.length>box.right;
    pen.text(x,Math.max(y,box.top+12*k),m.text,end?'end':'start','ink',12.5);
  }
}
